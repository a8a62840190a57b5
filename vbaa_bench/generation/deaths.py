"""Deaths of worker processes: give up what causes them, and end if the machine does."""

from collections import Counter
from dataclasses import dataclass, field
from typing import Final

from solver.instrument.errors import InputError
from vbaa_bench.dataset.aside import Rendering, clear_aside
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.workers.jobs import WorkerDiedError

# Deaths of processes that rendered the same frame or image, after which it is given up. Chosen: a
# single death has other reasons, such as a lack of memory or a person who ends the process.
FATAL: Final = 2
# Deaths during one job, beyond those of frames that are given up, after which the command ends.
# Chosen: they are due to the machine.
MAX_DEATHS: Final = 5
# Reason why a frame that was given up is missing.
DIED: Final = "the process that rendered it died"


class ImageError(InputError):
    """An image cannot be rendered without which there is no dataset."""


@dataclass
class Deaths:
    """Deaths of processes while they generated a dataset.

    `given_up` has the reasons of frames that are not rendered any more.
    """

    given_up: dict[str, str] = field(default_factory=dict)
    _renderings: Counter[Rendering] = field(default_factory=Counter)
    _others: Counter[str | None] = field(default_factory=Counter)

    def record(self, layout: Layout, job: str | None, death: WorkerDiedError) -> None:
        """Record the death of a process that did a job, or all jobs of the dataset if it is None.

        What it rendered is named in its temporary folder, which is removed. Raises ImageError if
        that is no frame and has caused FATAL deaths, and `death` if the job has had too many for
        other reasons.
        """
        renderings = clear_aside(layout, job)
        self._renderings += renderings
        fatal = [one for one in renderings if self._renderings[one] >= FATAL]
        for rendering in fatal:
            if not rendering.is_frame:
                raise ImageError(f"{rendering.name} cannot be rendered: {DIED} {FATAL} times")
        self.given_up |= {rendering.name: DIED for rendering in fatal}
        if not fatal:
            self._others[job] += 1
        if self._others[job] > MAX_DEATHS:
            raise death
