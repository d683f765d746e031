"""Words that all rooms use: errors, arrays, versions, threads, checks of TOML tables."""
