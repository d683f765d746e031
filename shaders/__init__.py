"""GLSL, one topic a file."""
