"""Point sets of fixed size."""
