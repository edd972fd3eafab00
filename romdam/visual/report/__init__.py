"""A suite's page."""
