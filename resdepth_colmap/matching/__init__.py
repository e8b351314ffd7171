"""The CPU PatchMatch."""
