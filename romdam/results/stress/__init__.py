"""Stress in result files."""
