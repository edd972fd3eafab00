"""File formats of ground motion, one file each."""
