"""Reduction methods, one file each."""
