"""Animations: interactive pages, GIF, MP4."""
