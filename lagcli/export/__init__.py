"""A model taken elsewhere: its dynamics as a function, and as code for other programs."""
