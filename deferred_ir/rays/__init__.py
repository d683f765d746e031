"""Embree, and what rays tell of a scene."""
