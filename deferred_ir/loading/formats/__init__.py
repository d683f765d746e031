"""Formats of model files, one a file: what each needs besides trimesh."""
