"""The card of an export: README.md, with what the data are, their columns and their licence."""

import re
from collections.abc import Sequence
from typing import Final

from vbaa_bench.dataset.column import markdown
from vbaa_bench.exports.columns import description
from vbaa_bench.exports.format import Format
from vbaa_bench.exports.source import Source

# Characters of a text that Markdown or HTML would take for markup.
_MARKED: Final = re.compile(r"[\\`*_\[\]<>#|&]")
DATA_LICENCE: Final = "CC-BY-4.0"
DATA_LICENCE_URL: Final = "https://creativecommons.org/licenses/by/4.0/"
PAPER: Final = (
    "M. Kaneko, N. Kanayama and T. Tsuji, IEEE/ASME Transactions on Mechatronics 6(1), 2001"
)
SUMMARY: Final = f"""\
Images of a vision-based active antenna: a thin flexible beam on a motor is pushed against an object
while a camera records how it bends ({PAPER}). The task is to estimate
from an image where the beam touches (contact distance), how hard (force), in which plane, and how
stiff the object is. The equilibrium of the beam is computed, and the images are rendered, with the
noise of an image sensor, by VBAA-Bench."""

_PAGE: Final = """\
{front}# {title}

{summary}

{counts}

## Load it

```python
{loading}```

## Files

- `rigs/<rig>/`: `rig.json` (the nominal rig with tolerances, which a method may use),
  `calibration/` (views of a board, view 0 in the calibration plane), `rest/` (the beam before
  contact), and `truth_manifest.json` (the true rig and camera, which a method must not use).
{layout}
- The digest of the dataset from which this was exported is `{digest}`;
  `vbaa-bench verify DATASET --against` it compares a copy of that dataset.
- Images are gray, with {bits} bits per pixel. The split of a frame is that of its push or rig.

## Columns

Lengths are in mm, angles in degrees and forces in N, as the suffixes state. A value that does not
exist is null. Frames of reference: *Sigma_a* turns with the motor (x along the beam at rest, z
towards the camera); *clamp* is Sigma_a at the true clamp; *Sigma_d* is the clamp's frame turned
about x by psi; *Sigma_o* is fixed.

**Readings**, which a method may use besides the image, `rigs/` and the frame's place in its push:

{readings}

**Labels**, the truth. A method that reads them, or `truth_manifest.json`, does not estimate:

{labels}

## Licence and citation

The data are licensed under [{licence}]({licence_url}), "The VBAA-Bench authors". Cite VBAA-Bench
and the paper: {paper}.
"""


def card(source: Source, chosen: Format) -> str:
    """Write the card of an export as Markdown."""
    counts = ", ".join(f"{count} in `{name}`" for name, count in source.splits.items())
    rigs = "one rig" if len(source.rigs) == 1 else f"{len(source.rigs)} rigs"
    depths = sorted({rig.bits for rig in source.rigs.values()})
    schema = source.schema
    return _PAGE.format(
        front=chosen.front_matter(source),
        title=_MARKED.sub(r"\\\g<0>", source.title),
        summary=SUMMARY,
        counts=f"{source.frames} frames of {rigs}: {counts}.",
        loading=chosen.loading.replace("{split}", next(iter(source.splits))),
        layout=chosen.layout,
        digest=source.digest,
        bits=" or ".join(map(str, depths)),
        readings=_described(["push_id", "step", *schema.readings]),
        labels=_described(schema.labels),
        licence=DATA_LICENCE,
        licence_url=DATA_LICENCE_URL,
        paper=PAPER,
    )


def _described(names: Sequence[str]) -> str:
    """Tabulate the entries of columns in the data dictionary."""
    return markdown({name: description(name) for name in names})
