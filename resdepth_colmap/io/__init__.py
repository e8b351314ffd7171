"""Files: workspaces, models, maps, images, clouds. No torch."""
