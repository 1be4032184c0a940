"""A model at one point: matrices, tangent spaces, steady motions."""
