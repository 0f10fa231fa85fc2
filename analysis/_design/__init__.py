"""The expected error over classes of integrands, and samples that minimise it."""
