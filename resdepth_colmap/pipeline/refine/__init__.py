"""Stage "refine": the network over the views of a workspace."""
