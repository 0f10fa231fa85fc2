"""Estimators of radiance: scenes from a world and a camera."""
