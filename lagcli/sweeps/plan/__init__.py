"""Plans of sweeps: the values of each row."""
