"""Checks of a scene against rays, and of what must not grow."""
