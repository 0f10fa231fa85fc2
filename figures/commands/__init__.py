"""Commands beside the figures: export, keep, mask."""
