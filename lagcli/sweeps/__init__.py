"""Parameter sweeps: many runs of one model, measured, kept, and never lost."""
