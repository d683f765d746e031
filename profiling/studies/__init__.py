"""Studies that the pages of docs quote, one a file."""
