"""Trajectories: samples of a run, in blocks or complete."""
