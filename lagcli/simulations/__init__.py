"""Simulations: model and settings to samples."""
