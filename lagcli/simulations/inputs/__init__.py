"""Inputs of runs: check of the range of their tables, and their representation in records."""
