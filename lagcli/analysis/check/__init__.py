"""Analysis of a model at its initial state: rank, multipliers, conserved quantities, time
scales."""
