"""Exact modal propagation: the loop and its kernels."""
