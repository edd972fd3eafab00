"""Strong-motion records: formats, correction, orientation, measures and suites."""
