"""Rendered rooms and objects with exact depth; knows nothing of training."""
