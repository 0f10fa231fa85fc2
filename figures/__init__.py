"""What people look at: figures, each a function ``(quality, progress) -> (picture, numbers)``."""
