"""Known functions of time: splines, and their pieces between knots."""
