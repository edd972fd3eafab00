"""Time integration of a system with gaps, in plain arrays."""
