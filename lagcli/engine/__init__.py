"""Numerical engine: Systems, their integration and linear algebra."""
