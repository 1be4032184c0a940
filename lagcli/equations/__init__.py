"""Model → Equations → what people read."""
