"""Names: scopes, families and indices, dependencies, suggestions for unknown names."""
