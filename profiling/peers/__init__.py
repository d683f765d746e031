"""Renderers that deferred-ir is held against, each in a process of its own; peer.py says what one offers."""
