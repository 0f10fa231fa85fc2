"""Which primitive a ray hits."""
