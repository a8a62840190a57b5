"""Basic types of the project, used by all other packages. No physics, no methods."""

import os
from typing import Final

# Largest image. Chosen: the largest cameras have 150 megapixels, the largest scene 67.
MAX_PIXELS: Final = 200_000_000
# OpenCV compares an image's size with this before it allocates memory for its pixels, in all
# formats. It reads the variable once, when it is imported: this package is imported before.
os.environ.setdefault("OPENCV_IO_MAX_IMAGE_PIXELS", str(MAX_PIXELS))
