"""Computed from results: no file is opened here, no figure drawn."""
