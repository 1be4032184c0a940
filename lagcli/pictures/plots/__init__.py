"""Plots: curves of runs and of sweeps."""
