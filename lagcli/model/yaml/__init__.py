"""YAML with line and column: text, nodes, error messages, and replacement of values."""
