"""Presentation: equations as formulas and derivation steps, independent of the output format."""
