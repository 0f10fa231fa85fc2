"""Sequences by digits: generator matrices over F2 and over prime fields, and radical inverses."""
