"""What a pass sees of a frame: its ports, the scene and the lights on the GPU."""
