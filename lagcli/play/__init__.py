"""A page on which a model's values are moved and its motion follows."""
