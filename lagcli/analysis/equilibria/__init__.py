"""Equilibria, their stability, and branches of equilibria as a parameter varies."""
