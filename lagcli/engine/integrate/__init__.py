"""Integration: single runs, runs that switch, batches, and the choice of the method."""
