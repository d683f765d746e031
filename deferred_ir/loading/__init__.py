"""Files to scenes."""
