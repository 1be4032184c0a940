"""The core: C kernels and their binding, built when the package is installed."""
