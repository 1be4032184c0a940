"""Equilibria, their stability, and branches of them over a parameter."""
