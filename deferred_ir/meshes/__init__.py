"""Triangles for shadow maps: clusters, levels of detail, subdivision. No OpenGL."""
