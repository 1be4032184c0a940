"""Rows of sweeps: run in batches, in processes, or on a cluster."""
