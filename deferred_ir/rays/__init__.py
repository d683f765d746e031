"""Ray queries with Embree, and what is computed from their hits."""
