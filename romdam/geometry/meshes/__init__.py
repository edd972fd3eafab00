"""Mesh files: readers, and what is checked of a mesh."""
