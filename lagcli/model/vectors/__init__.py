"""Vectors and rotations as coordinates, in constraints and in initial values."""
