"""Equations → numbers."""
