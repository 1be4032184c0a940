"""The version of lagcli, stated here alone."""

__version__ = "0.1.0"
