"""Symbolic equations of motion: derivation, presentation and rendering."""
