"""The command scenes: what scenes are part of this package."""

from itertools import groupby

from vbaa_bench.cli.interrupt import importing
from vbaa_bench.cli.options import AsJson
from vbaa_bench.report.console import print_result


def scenes(as_json: AsJson = False) -> None:
    """List the scenes of this package, whose names the other commands take in place of a file.

    For a variant of a scene see the options --set, --frames and --rigs of `vbaa-bench generate`.
    """
    with importing():
        from vbaa_bench.scene.shipped import list_scenes

    listed = list_scenes()
    width = max(len(scene.name) for scene in listed)
    blocks = (
        "\n".join(f"{scene.name:{width}}  {scene.shows}" for scene in group)
        for _, group in groupby(listed, key=lambda scene: scene.folder)
    )
    record = {
        "scenes": [
            {"name": scene.name, "shows": scene.shows, "file": str(scene.path)} for scene in listed
        ]
    }
    print_result(record, "\n\n".join(blocks), as_json)
