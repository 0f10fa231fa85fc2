"""Errors on integrands with exact integrals, and how they are judged."""
