"""What blocks are made from."""
