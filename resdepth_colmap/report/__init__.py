"""The page that shows what the refinement changed: one file, no network."""
