"""Families of names in formulas."""
