"""Simplification: expressions arranged as a person would write them."""
