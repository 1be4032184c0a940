"""Inputs of runs: whether their tables reach far enough, and how records keep them."""
