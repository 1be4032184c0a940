"""Switching in formulas: contacts, friction, impacts, events."""
