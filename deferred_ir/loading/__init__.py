"""Loads scenes from files."""
