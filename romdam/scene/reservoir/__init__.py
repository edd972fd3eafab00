"""Water on a dam: the faces it wets, and a reservoir's own mesh."""
