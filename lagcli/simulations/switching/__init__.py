"""Contacts and events of a run: its log, and which constraints hold at samples."""
