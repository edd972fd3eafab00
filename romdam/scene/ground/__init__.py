"""Rock whose boundary takes waves up, and its free field."""
