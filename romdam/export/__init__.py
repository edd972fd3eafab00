"""A job for other codes: a neutral description and a module for each code that writes it; or its matrices."""
