"""Rendered rooms and the training on them."""
