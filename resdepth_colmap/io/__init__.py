"""Files: workspaces, models, maps, images, clouds. No torch."""

import zlib  # noqa: F401 - has to be loaded before pycolmap: see png.py
