"""Basic types of the project, used by all other packages. No physics, no methods."""

from typing import Final

# Largest image. Chosen: the largest cameras have 150 megapixels, the largest scene 67.
MAX_PIXELS: Final = 200_000_000
