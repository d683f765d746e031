"""What all rooms use: errors, array types, versions, threads, files, TOML tables, colour."""
