"""Information limits: maps of a scene, and those of the frames of a dataset."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import polars as pl

from vbaa_bench.api.data import AnyDataset, dataset_folder, usable_variant, worker_count
from vbaa_bench.dataset.collection import CollectionLayout, is_collection
from vbaa_bench.limits import designs, maps, places, requirements, summaries
from vbaa_bench.limits.dataset_limits import dataset_limits
from vbaa_bench.limits.page import limits_page
from vbaa_bench.limits.requirements import Requirement
from vbaa_bench.limits.summaries import Summary
from vbaa_bench.limits.summary_table import SummaryTable, answers, summary_table
from vbaa_bench.scene.load import load_scene
from vbaa_bench.scoring.information_sets import SETS, check_information

Progress = Callable[[int, int], None]
# Places of a map, in % of L. Chosen: six columns fit a telephone; deflections from hardly visible
# to large.
CONTACT_DISTANCES: tuple[float, ...] = (15, 30, 45, 60, 75, 90)
DEFLECTIONS: tuple[float, ...] = (1, 2, 5, 10, 20, 30)


def _ignore(_done: int, _total: int) -> None:
    """Show no progress."""


@dataclass(frozen=True)
class LimitMaps:
    """Information limits of the designs of a scene over contact distance and deflection.

    A limit is the smallest standard deviation that a method without bias can have (Cramer, Rao).
    `table` has one row for each design and place; `designs` are summaries over all places.
    """

    title: str
    facts: Sequence[str]
    table: pl.DataFrame
    designs: Sequence[Summary]
    required: Sequence[Requirement]
    information: str

    def page(self) -> str:
        """Write the maps as a page of HTML, without references to other files."""
        return limits_page(
            self.title, self.facts, self.table, self.designs, self.required, self.information
        )

    def summary(self) -> SummaryTable:
        """Return the heads of a table, and a row for each design, as text."""
        return summary_table(self.designs, self.required)

    def answers(self) -> list[str]:
        """Answer each requirement in a sentence."""
        return answers(self.designs, self.required)

    def record(self) -> dict[str, Any]:
        """Return the maps as an object for JSON."""
        return {
            "information": self.information,
            "requirements": [str(one) for one in self.required],
            "designs": [one.record() for one in self.designs],
            "places": self.table.to_dicts(),
        }


def map_limits(
    scene: Path | str,
    *,
    vary: Sequence[str] = (),
    require: Sequence[str] = (),
    information: str = "image",
    contact_distance_pct: Sequence[float] = CONTACT_DISTANCES,
    deflection_pct: Sequence[float] = DEFLECTIONS,
    seed: int | None = None,
    settings: Sequence[str] = (),
    workers: int | None = None,
    variant: str | None = None,
    progress: Progress = _ignore,
) -> LimitMaps:
    """Compute the information limits of a scene, and of variants of it, without rendering.

    `scene` is a file, or the name of a shipped scene. `vary` has values to compare, such as
    "beam.diameter_mm=0.4,0.8", and `require` the largest standard deviations, such as
    "x_c_pct_L=0.1". `information` names the data that a method uses: planar, image, moment, force
    or push. Distances and deflections are in % of the beam's length. Raises InputError.

    >>> place = {"contact_distance_pct": [50], "deflection_pct": [10]}
    >>> maps = vb.map_limits("quickstart", vary=["beam.diameter_mm=0.4,0.8"], **place, workers=1)
    >>> [round(limit, 3) for limit in maps.table["x_c_limit_pct_L"]]
    [0.012, 0.014]
    """
    check_information(information, "--information")
    required = requirements.requirements(list(require), information)
    grid = places.grid(contact_distance_pct, deflection_pct)
    # A mistake in the file or in the settings is not one of a design.
    file = load_scene(scene, seed, settings)
    compared = designs.designs(file.path, vary, information, seed, settings)
    chosen = usable_variant(variant)
    progress(0, len(grid.contact_distance_pct) * sum(one.file is not None for one in compared))
    table = maps.maps(compared, grid, information, chosen, worker_count(workers, chosen), progress)
    facts = [f"Information set {information}: {SETS[information]}, with all data before contact."]
    if information == "push":
        facts.append("The steps of a push are the deflections of the map, up to that of the place.")
    facts += [f"Changed in the scene: {', '.join(settings)}."] if settings else []
    facts += ["Random keys have the values of their first draw."] if file.is_random else []
    return LimitMaps(
        f"Information limits: {file.scene.title}",
        facts,
        table,
        summaries.summaries(table, compared, required),
        required,
        information,
    )


def store_limits(
    data: AnyDataset,
    *,
    workers: int | None = None,
    variant: str | None = None,
    progress: Progress = _ignore,
    on_rig: Progress = _ignore,
) -> int:
    """Compute the information limits of all frames; store them in the dataset or collection.

    `score` and `write_report` then show them. `progress` is called with the pushes of a dataset
    that are done, and all of them; `on_rig`, for a collection, with its datasets. Returns the
    number of frames. Raises InputError.

    >>> vb.store_limits(data, workers=1)
    4
    """
    root = dataset_folder(data)
    rigs = CollectionLayout(root).rigs() if is_collection(root) else {}
    roots = [layout.root for layout in rigs.values()] or [root]
    chosen, frames = usable_variant(variant), 0
    count = worker_count(workers, chosen)
    for number, one in enumerate(roots, start=1):
        table = dataset_limits(one, chosen, count, progress)
        frames += table["frame_id"].n_unique()
        if rigs:
            on_rig(number, len(roots))
    return frames
