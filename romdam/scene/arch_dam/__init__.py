"""The arch dam generator."""
