"""Sparse factorisations and eigenproblems."""
