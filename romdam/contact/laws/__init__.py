"""What one gap answers."""
