"""Blocks whose stiffness and mass come from files of other programs."""
