"""Known functions of time: splines, and their polynomial pieces."""
