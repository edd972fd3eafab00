"""How far results are from what they stand for."""
