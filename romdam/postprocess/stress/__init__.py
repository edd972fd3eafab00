"""What stress says: envelopes, percentiles of faces, sections."""
