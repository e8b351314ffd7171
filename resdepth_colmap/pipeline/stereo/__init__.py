"""Stage "stereo": initial depth and normal maps, by PatchMatch."""
