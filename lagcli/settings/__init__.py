"""Settings of simulations: declared once, given on several levels, resolved and checked."""
