"""The gravity dam generator."""
