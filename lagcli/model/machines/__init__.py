"""Machines: bodies, joints and forces, expanded to coordinates, T, V and constraints."""
