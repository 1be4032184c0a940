"""Sweep files: the journal during a sweep, the HDF5 file after it."""
