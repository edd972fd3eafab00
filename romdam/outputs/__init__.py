"""Results: datasets, files, fields rebuilt from the reduced coordinates, and figures."""
