"""Reduction to independent coordinates: coordinate partitioning, second kind, Maggi, closed forms."""
