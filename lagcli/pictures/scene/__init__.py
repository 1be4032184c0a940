"""Scenes: the view of a model at the samples, and its drawing."""
