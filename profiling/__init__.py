"""Error against run time."""
