"""Names: what is declared, what an expression may use, families and indices."""
