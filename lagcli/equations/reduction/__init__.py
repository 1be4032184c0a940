"""Reduction to independent coordinates: partitioning, second kind, Maggi, closed forms."""
