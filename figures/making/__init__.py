"""What makes the figures: workers, the output folder, finished cells."""
