"""Tapes: straight-line programs on numbers, and their interpreters in Python."""
