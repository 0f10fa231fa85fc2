"""What several figures share: sweeps, sheets of images, scenes."""
