"""Switching: contacts, friction, limits, events."""
