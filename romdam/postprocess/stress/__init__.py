"""Measures of stress: envelopes, percentiles of faces, sections."""
