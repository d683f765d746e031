"""Scenes: geometry, materials, camera, lights, motions. No OpenGL, no files."""
