"""From what was recorded to what the model is shaken with."""
