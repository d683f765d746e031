"""Global illumination from Python in milliseconds: instant radiosity and deferred shading on OpenGL."""
