"""Water in joints and under a dam: its pressure on both faces of every gap."""
