"""Figures and 3-D views."""
