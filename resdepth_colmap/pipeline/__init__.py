"""The stages: each a loop over files round a pure function on arrays."""
