"""Figures and tables of chapter 6 of the thesis."""
