"""Pictures of arrays: colours, strips. No workspace."""
