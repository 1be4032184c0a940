"""Analyses of a model: what it tells before and beside its motion."""
