"""Consistency checks of the files of a rig: images that are not used, and their names."""

import re
from collections.abc import Iterator

from solver.instrument.hashes import read_hashes
from solver.instrument.images import FORMATS
from solver.instrument.observation import IMAGE_NAMES, Observations
from solver.lab.findings import Finding


def file_findings(observations: Observations) -> tuple[Finding, ...]:
    """List the files beside rig.json whose names hide them; none for a generated tree."""
    if read_hashes(observations.root) is not None:
        return ()
    return (*_unused(observations), *_first_view(observations))


def _unused(observations: Observations) -> Iterator[Finding]:
    used = {*observations.board_views, *observations.rest_images, *observations.ground_images}
    for name in IMAGE_NAMES:
        folder, start = name.split("/")
        names = [
            f"{folder}/{path.name}"
            for path in sorted((observations.root / folder).glob("[!.]*"))
            if path not in used and (path.suffix.lower() in FORMATS or path.name.startswith(start))
        ]
        if names:
            yield Finding(
                "images_unused",
                f"not used: {', '.join(names)}; names are {start}00.png, {start}01.png, ...",
            )


def _first_view(observations: Observations) -> Iterator[Finding]:
    first = observations.board_views[0]
    if not re.match(r"view_0+(?!\d)", first.name):
        yield Finding(
            "first_view_missing",
            f"view_00{first.suffix} is missing: {first.name} defines plane C; if it is the view in "
            f"plane C, rename it to view_00{first.suffix}",
        )
