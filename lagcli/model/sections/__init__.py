"""The keys of a model file, one module each."""
