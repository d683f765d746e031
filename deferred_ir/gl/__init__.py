"""The only place with raw OpenGL."""
