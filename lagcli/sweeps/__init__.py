"""Parameter sweeps: many runs of one model, their measures and their files."""
