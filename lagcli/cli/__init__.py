"""The command line: one short module per command. Nothing else imports it."""
