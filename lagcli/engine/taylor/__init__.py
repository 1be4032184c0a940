"""Taylor series of the motion: programs that compute coefficients order by order."""
