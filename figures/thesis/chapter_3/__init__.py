"""Figures and tables of chapter 3 of the thesis."""
