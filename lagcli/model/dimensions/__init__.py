"""Dimensional analysis: dimensions of a model's quantities, and derived units."""
