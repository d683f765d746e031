"""Ray-traced references, and the distance of images from them."""
