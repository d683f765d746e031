"""The viewer, `deferred-ir view`: a window in which light moves and the bounce follows."""
