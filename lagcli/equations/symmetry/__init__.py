"""Linear symmetries of a system, and its conserved quantities."""
