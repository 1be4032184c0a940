"""What a model tells before it moves: rank, multipliers, conserved quantities, time scales."""
