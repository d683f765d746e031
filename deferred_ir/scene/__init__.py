"""What a scene is: geometry, materials, camera, lights, motions. No OpenGL, no files."""
