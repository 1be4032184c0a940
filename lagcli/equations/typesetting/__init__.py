"""Formulas as trees of nodes, and their text, LaTeX and MathML."""
