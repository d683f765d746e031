"""How far the passes are from what the machine could do."""
