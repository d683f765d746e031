"""The passes of the render graphs; one file a pass, found by its module's name."""
