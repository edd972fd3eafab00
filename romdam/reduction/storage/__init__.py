"""Reduced models and large matrices on disk."""
