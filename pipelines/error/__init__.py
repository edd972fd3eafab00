"""Statements of error: estimate, certificate, verification, study, comparison of variants."""
