"""Settings of simulations: declared once, merged from several levels, and checked."""
