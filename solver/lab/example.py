"""The example rig, which is part of this software, and what to do next with a camera."""

import os
from pathlib import Path
from typing import Final

from solver.instrument.errors import InputError

EXAMPLE: Final = Path(__file__).parents[1] / "example"
VIDEO: Final = "push.avi"


def example_rig() -> Path:
    """Return the folder of the example rig, as short as possible. Raises InputError without it."""
    if not (EXAMPLE / "rig.json").is_file():
        raise InputError(f"{EXAMPLE}: is missing; copy solver/ with its folder example/")
    inside = EXAMPLE.is_relative_to(Path.cwd())
    return Path(os.path.relpath(EXAMPLE)) if inside else EXAMPLE


def next_steps(example: Path) -> str:
    """Say what to do next: more with the example in the folder `example`, and with a camera."""
    return f"""
More of the example rig:
  python -m solver check --rig {example}                        # is the rig in order?
  python -m solver {example / VIDEO} --rig {example} --overlay push.mp4

Your own camera, each step explained in solver/README.md:
  1. write rig/rig.json for your beam, clamp and board
  2. python -m solver board board.svg --rig rig                 # print it, glue it onto a plate
  3. python -m solver snap 0 rig/calibration/view_00.png        # the board, six to twelve times
  4. python -m solver snap 0 rig/rest/rest_00.png --rig rig     # the beam at rest, twice or more
     python -m solver check --rig rig                           # until it reports no problem
  7. python -m solver 0 --rig rig --overlay seen.mp4            # push the beam, and read the force
Steps 5 and 6 calibrate EI and learn the beam: without them, a force is as wrong as EI is.
"""
