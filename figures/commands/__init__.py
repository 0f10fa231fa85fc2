"""Commands beside the figures: gpu, export, keep."""
