"""Sources of blocks: boxes, mesh files, matrices, whole dams, cuts."""
