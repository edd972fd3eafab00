"""Shapes to meshes of blocks: mesh files, cut dams, generated dams, matrices of other programs."""
