"""HTML that a notebook shows of an object."""
