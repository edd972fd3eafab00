"""File formats of meshes, one file each."""
