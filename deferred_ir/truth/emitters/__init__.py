"""What shines, as the path tracer samples it, one kind a file."""
