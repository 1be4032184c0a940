"""Switching systems: contact, impacts, friction, events."""
