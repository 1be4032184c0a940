"""Expression language: tokens, syntax trees, SymEngine expressions, units."""
