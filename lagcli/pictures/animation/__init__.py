"""Animations: pages that play a run, GIF, MP4."""
