"""Runs plans: renderer, executor, reuse, accumulation."""
