"""Analyses of a model at a state or along a run."""
