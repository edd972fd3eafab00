"""Fields of a result to look at from all sides: a window, or a page for the browser."""
