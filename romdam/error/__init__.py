"""Distance of results from what they stand for."""
