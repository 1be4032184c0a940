"""Presentation: equations as formulas and steps, independent of the output format."""
