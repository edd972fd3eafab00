"""A job for other codes: one neutral description, and a module for each code that writes it."""
