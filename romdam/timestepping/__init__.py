"""Equilibrium, integrators, energy."""
