"""Pictures: scenes, plots, animations, reports."""
