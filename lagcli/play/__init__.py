"""Interactive simulation in the browser: server, runs, page."""
