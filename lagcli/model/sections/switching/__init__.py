"""What of a model switches: contacts, friction, limits, events."""
