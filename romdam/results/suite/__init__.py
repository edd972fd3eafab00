"""Files of a suite."""
