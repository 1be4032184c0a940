"""Simulations: a model and settings → samples."""
