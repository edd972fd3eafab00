"""A job for other programs."""
