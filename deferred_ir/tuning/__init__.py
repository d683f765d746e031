"""What settings cost on this machine, and which of them fit a given time."""
