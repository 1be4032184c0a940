"""YAML with line and column: text, nodes, error texts, and values written back."""
