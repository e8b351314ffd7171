"""Measures of depth maps against truth."""
