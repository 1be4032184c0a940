"""Modes, instants and event functions of the reference engine."""
