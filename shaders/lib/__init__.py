"""GLSL shared by writers and readers."""
