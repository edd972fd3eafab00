"""Finite elements of one block: stiffness, mass and loads."""
