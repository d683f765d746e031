"""The render graph as data: ports, passes, parameters, files, and its compilation to a plan. No OpenGL."""
