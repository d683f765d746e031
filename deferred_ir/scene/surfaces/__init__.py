"""Materials, their textures, and how surfaces reflect."""
