"""Mathematics of cameras and maps. No files."""
