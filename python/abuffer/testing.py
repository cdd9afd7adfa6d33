"""Checks for other renderers."""
