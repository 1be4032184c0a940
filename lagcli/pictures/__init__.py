"""Pictures of a run: its scene, plots, animations, pages."""
