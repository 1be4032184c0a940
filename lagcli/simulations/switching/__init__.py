"""Contacts and events of a run: the event log, and active constraints at samples."""
