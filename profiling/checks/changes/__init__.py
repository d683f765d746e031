"""Changes of scenes for the extreme cases."""
