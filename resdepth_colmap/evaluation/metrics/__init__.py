"""Metrics of depth maps, against ground truth and reference-free."""
