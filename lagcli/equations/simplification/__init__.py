"""Simplification: expressions arranged for reading."""
