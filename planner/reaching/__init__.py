"""Joint angles that put the tips where they are to touch, certified, or why there are none."""
