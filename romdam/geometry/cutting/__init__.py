"""One mesh cut into blocks, along faces of its elements or through them."""
