"""Graph files, read by name."""
