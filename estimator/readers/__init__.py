"""Readers: raw signals of tactile sensors to a patch of surface with covariance."""
