"""Page of the comparison of information limits with re-rendered images and noisy exposures."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from results.limits import agreement, trials
from results.limits.agreement import LimitedFrame, LitScene
from vbaa_bench.scene.load import load_scene
from vbaa_bench.scoring.tables import markdown_table

Record = dict[str, Any]


def measure(
    scenes: Sequence[Path], variant: str, frames: int, exposures: int, tick: Callable[[], None]
) -> Record:
    """Compare the limits of some frames of each scene; expose the first of them repeatedly.

    `tick` is called after each frame. Raises InputError, and EquilibriumError.
    """
    agreements, repeated = [], []
    for path in scenes:
        lit = LitScene(load_scene(path), variant)
        for number, spec in enumerate(lit.frames(frames)):
            agreements.append(agreement.agreement(lit, spec))
            if number == 0:
                repeated.append(trials.trials(LimitedFrame(lit, spec), exposures))
            tick()
    return {"agreement": agreements, "trials": repeated}


def markdown(record: Record, command: str) -> str:
    """Format a record as a page in Markdown; `command` is the one that makes it."""
    return f"""# Information limits: re-rendered images against the closed form

The limit is the least standard deviation of an unbiased estimate (Cramer and Rao) from one image.
Clamp, beam and camera are known here; the brightness of beam and background and the beam's width
are not. psi is known or unknown. Ratios are standard deviations of the re-rendered image's
information over those of the closed form, in the order x_c, s_c, force, psi: with the radiance
across the beam as rendered (`closed`), and with that of the scene's lamps and paints (`lamps`), by
which datasets get their limits. `step` is the largest change of a limit with half or double the
step of the derivatives; `shift` is the ratio for a shift of the image, the smallest and the largest
of ten parts of the beam. `s` is the time of one frame with four parameters on a shared machine.

{markdown_table(agreement.HEADS, agreement.lines(record["agreement"]))}

One expected image is exposed repeatedly with the sensor's whole noise drawn anew, and x_c is
estimated by maximum likelihood, with s_c, force, brightness of beam and background, and width
unknown. The spread of the estimates over the limit is uncertain by 1.6 % with 2,000 exposures. The
second step is that of an estimate whose image is rendered anew at the first estimate.

{markdown_table(trials.HEADS, trials.lines(record["trials"]))}

```sh
{command}
```
"""
