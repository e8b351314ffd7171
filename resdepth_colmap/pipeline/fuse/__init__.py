"""Stage "fuse": depth maps to one cloud."""
