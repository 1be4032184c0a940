"""Trajectories: samples of a run, in blocks or as a whole."""
