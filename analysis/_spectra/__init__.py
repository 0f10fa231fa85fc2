"""Spectra of points and of errors, and errors after a filter."""
