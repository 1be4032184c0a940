"""Constraints: index-1 form, projection, consistent initialization, rank."""
