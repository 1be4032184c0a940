"""Linear symmetries of a system, and the conserved quantities that follow from them."""
