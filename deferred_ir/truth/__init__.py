"""Ray-traced truth, and how far an image is from it."""
