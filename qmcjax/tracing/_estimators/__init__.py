"""Estimators of radiance: scenes made of a world and a camera."""
