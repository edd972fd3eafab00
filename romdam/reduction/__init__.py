"""Craig-Bampton reduction of blocks and their synthesis into one diagonal system."""
