"""The laboratory of many lights: casting, choosing, keeping and summing VPLs. No OpenGL."""
