"""Record of what is measured before the images of a dataset, in truth/metering.json.

All images depend on it. It is therefore measured once: a command that finishes, repairs or extends
the dataset reads it.
"""

import contextlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple, Self

import numpy as np

from solver.instrument.errors import InputError
from solver.instrument.files import write_bytes
from solver.instrument.hashes import digest
from vbaa_bench.dataset.document import read_json
from vbaa_bench.dataset.faults import read_hash_table
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.generation.frame_renderer import Metering
from vbaa_bench.render.sample_table import SampleTable


class MeteringRecord(NamedTuple):
    """The metering, and the names of the frames from which its sample table was learned.

    `failed` has the reasons why other frames could not be rendered for it. They are missing in the
    dataset as well.
    """

    metering: Metering
    frames: tuple[str, ...] = ()
    failed: Mapping[str, str] = {}

    def encoded(self) -> bytes:
        """Encode the record as the content of metering.json."""
        document = {
            "exposure_per_radiance": self.metering.exposure,
            "sample_table": self.metering.table.factors.tolist(),
            "frames": list(self.frames),
            "failed": dict(self.failed),
        }
        return (json.dumps(document, indent=2) + "\n").encode()

    @classmethod
    def read(cls, path: Path) -> Self:
        """Read a record. Raises InputError, KeyError, TypeError or ValueError if it is damaged."""
        document = read_json(path)
        table = SampleTable(np.array(document["sample_table"], dtype=np.float64))
        metering = Metering(float(document["exposure_per_radiance"]), table)
        return cls(metering, tuple(document["frames"]), dict(document["failed"]))


def recorded_metering(layout: Layout, *, is_intact: bool) -> MeteringRecord | None:
    """Read the record of a dataset; None if there is none, or it is damaged."""
    if is_intact or _recorded_digest(layout) is None:  # an incomplete dataset has no table yet
        with contextlib.suppress(InputError, KeyError, TypeError, ValueError):
            return MeteringRecord.read(layout.metering)
    return None


def write_metering(layout: Layout, record: MeteringRecord) -> None:
    """Write the record, unless it differs from the one that the dataset's hashes list.

    Raises InputError if it does: the images that exist depend on another one. Raises OSError.
    """
    data = record.encoded()
    if _recorded_digest(layout) not in (None, digest(data)):
        raise InputError(
            f"{layout.metering}: is damaged, and exposure or numbers of samples that were measured "
            "again differ from those of the images that exist; delete the dataset and generate it "
            "again"
        )
    write_bytes(layout.metering, data)


def _recorded_digest(layout: Layout) -> str | None:
    return (read_hash_table(layout.truth).hashes or {}).get(layout.metering.name)
