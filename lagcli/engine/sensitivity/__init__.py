"""Sensitivities: the variational equations as a System, and their initial values."""
