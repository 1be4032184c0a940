"""The core: plain C, and its binding by ctypes."""
