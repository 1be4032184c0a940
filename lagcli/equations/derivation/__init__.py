"""Derivation: Lagrange's equations, their Jacobians, integrability, degrees of freedom."""
