"""The CPU PatchMatch: how right and how fast it is."""
