"""Output of analyses: text and files."""
