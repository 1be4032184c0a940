"""Families in formulas: recognition and index form."""
