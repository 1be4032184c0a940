"""Dimensional analysis: the dimensions of what a model states, and the units that follow."""
