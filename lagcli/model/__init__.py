"""YAML text → Model."""
