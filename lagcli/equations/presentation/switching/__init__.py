"""What switches, as formulas: contacts, friction, impacts, events."""
