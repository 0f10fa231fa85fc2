"""Shared by all packages: words and digits, finite fields, compensated sums, pytrees, argument checks."""
