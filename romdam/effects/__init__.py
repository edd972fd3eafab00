"""Physical effects: what each adds to the equations of motion, at full order and reduced, in one module."""
