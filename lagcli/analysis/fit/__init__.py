"""Fits: parameters and initial values found from measured data by least squares."""
