"""Training the network on views whose depth is known."""
