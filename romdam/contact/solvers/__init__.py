"""Methods for the gap-space problem, one file each."""
