"""Figures and tables of chapter 5 of the thesis."""
