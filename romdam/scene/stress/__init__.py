"""Places of stress: nodes, faces, sections, and those that are left out of headlines."""
