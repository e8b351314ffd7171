"""Documents made of measured figures (docs/measurements/*.json)."""
