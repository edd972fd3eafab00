"""Where stress is written: nodes, faces, sections, and what is left out of headlines."""
