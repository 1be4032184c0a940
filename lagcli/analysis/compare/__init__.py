"""Comparisons of formulations, methods, tolerances and models."""
