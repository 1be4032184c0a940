"""Linear models and modes about an operating point."""
