"""Figures of depth maps: against the truth, and without any."""
