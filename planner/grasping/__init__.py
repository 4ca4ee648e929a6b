"""A grasp about the axis that holds whatever the belief still allows."""
