"""Plans of sweeps: which values each row has."""
