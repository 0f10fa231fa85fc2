"""What people look at: one module a figure, each with ``make(quality, progress) -> (picture, numbers)``."""
