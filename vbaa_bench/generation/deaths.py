"""Deaths of worker processes: give up frames that cause them, and end if the machine does."""

from collections import Counter
from dataclasses import dataclass, field
from typing import Final

from vbaa_bench.dataset.aside import clear_aside
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.generation.job import WorkerDiedError

# Deaths of processes that rendered the same frame, after which the frame is given up. Chosen: a
# single death has other reasons, such as a lack of memory or a person who ends the process.
FATAL: Final = 2
# Deaths during one job, beyond those of frames that are given up, after which the command ends.
# Chosen: they are due to the machine.
MAX_DEATHS: Final = 5
# Reason why a frame that was given up is missing.
DIED: Final = "the process that rendered it died"


@dataclass
class Deaths:
    """Deaths of processes while they generated a dataset.

    `given_up` has the reasons of frames that are not rendered any more.
    """

    given_up: dict[str, str] = field(default_factory=dict)
    _frames: Counter[str] = field(default_factory=Counter)
    _others: Counter[str | None] = field(default_factory=Counter)

    def record(self, layout: Layout, job: str | None, death: WorkerDiedError) -> None:
        """Record the death of a process that did a job, or all jobs of the dataset if it is None.

        The frame that it rendered is in its temporary folder, which is removed. Raises `death` if
        the job has had too many.
        """
        frames = clear_aside(layout, job)
        self._frames += frames
        fatal = [name for name in frames if self._frames[name] >= FATAL]
        self.given_up |= dict.fromkeys(fatal, DIED)
        if not fatal:
            self._others[job] += 1
        if self._others[job] > MAX_DEATHS:
            raise death
