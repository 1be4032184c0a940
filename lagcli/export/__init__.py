"""Export of a model: its dynamics as a function, and as code for other programs."""
