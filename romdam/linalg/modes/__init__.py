"""Lowest eigenpairs of large sparse matrices: by block Lanczos, or by LOBPCG under multigrid."""
