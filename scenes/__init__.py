"""Built-in scenes and the scripts that made them."""
