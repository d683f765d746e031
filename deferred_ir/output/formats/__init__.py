"""The kinds of image files: a file a suffix, found by its name, which reads and writes them."""
