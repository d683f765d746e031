"""Lights, one kind a file."""
