"""A scene on the GPU."""
