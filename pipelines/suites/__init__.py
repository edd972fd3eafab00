"""A suite: its plan, its runs, its folder, its workers."""
