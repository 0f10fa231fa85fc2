"""Visibility over time without samples."""
