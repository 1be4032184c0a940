"""Tapes: straight-line code for numbers, and what evaluates it in Python."""
