"""Radical inverses."""
