"""Output of analyses: tables, text and files."""
