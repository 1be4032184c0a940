"""Modes, instants and watched functions of the reference engine."""
