"""What the passes that draw or read shadow maps share."""
