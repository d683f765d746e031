"""Sample patterns and orders of points; nothing here knows what is sampled."""
