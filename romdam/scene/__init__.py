"""Scene: blocks, joints, supports and loads as plain arrays."""
