"""What the viewer can change of a scene: lists of its parts, and recorded paths. Knows no window."""
