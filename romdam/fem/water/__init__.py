"""Water that a dam moves: added mass, and waves in a reservoir that goes on upstream."""
