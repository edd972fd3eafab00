"""Mortar coupling of faces whose meshes need not match: segments, dual multipliers, weights."""
