"""COLMAP's formats: workspaces, models, maps, cfg files, masks."""
