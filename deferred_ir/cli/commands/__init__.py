"""The commands of `deferred-ir`: a file a command, found by its name."""
