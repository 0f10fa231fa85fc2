"""Ray intersection: the primitive that a ray hits."""
