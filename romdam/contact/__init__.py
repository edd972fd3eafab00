"""The problem of all gaps in one step: laws, and solvers in gap space."""
