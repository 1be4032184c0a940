"""Result files in HDF5."""
