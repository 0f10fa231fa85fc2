"""Making figures: workers, the output folder, finished cells."""
