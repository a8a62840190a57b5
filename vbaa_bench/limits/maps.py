"""Maps of information limits over contact distance and deflection, from geometry alone."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, NamedTuple

import numpy as np
import polars as pl

from solver.instrument.units import MILLIMETRE, PERCENT
from vbaa_bench.limits.designs import Design
from vbaa_bench.limits.places import Grid, Place, places, rig_of_map
from vbaa_bench.limits.table import SCHEMA as LIMITS
from vbaa_bench.limits.table import LimitsOfPushes
from vbaa_bench.limits.visible_places import visible_by_plan
from vbaa_bench.render.variant import activate
from vbaa_bench.scene.load import SceneFile
from vbaa_bench.workers.pool import Pool

Progress = Callable[[int, int], None]
_LIMITS: Final = tuple(name for name in LIMITS if "_limit_" in name)
# A row per design and place. `force_mn` is the true force; `reason` is why a place is blank. A
# null limit at a place with a force cannot be determined.
SCHEMA: Final = {
    "design": pl.String,
    "contact_distance_mm": pl.Float64,
    "contact_distance_pct_L": pl.Float64,
    "deflection_pct": pl.Float64,
    "information": pl.String,
    "force_mn": pl.Float64,
    **dict.fromkeys(_LIMITS, pl.Float64),
    "x_c_limit_pct_L": pl.Float64,
    "force_limit_mn": pl.Float64,
    "force_limit_pct": pl.Float64,
    "reason": pl.String,
}


class MapColumn(NamedTuple):
    """The places of one design at one contact distance."""

    number: int
    file: SceneFile
    contact_distance_pct: float
    deflection_pct: tuple[float, ...]


def maps(
    designs: Sequence[Design],
    grid: Grid,
    information: str,
    variant: str,
    workers: int,
    progress: Progress,
) -> pl.DataFrame:
    """Compute the limits of all possible designs at all places of a grid, as a table of SCHEMA.

    `progress` gets the numbers of finished and of all contact distances. Raises InputError.
    """
    jobs = [
        ("column", (MapColumn(number, design.file, distance, grid.deflection_pct), information))
        for number, design in enumerate(designs)
        if design.file is not None
        for distance in grid.contact_distance_pct
    ]
    with Pool(min(workers, len(jobs)), _Worker, (variant,)) as pool:
        columns = pool.run(jobs, lambda done: progress(done, len(jobs)))
    names = [designs[column.number].name for _, (column, _) in jobs]
    rows = [
        {"design": name, **row}
        for name, column in zip(names, columns, strict=True)
        for row in column
    ]
    return pl.DataFrame(rows, schema=SCHEMA, orient="row")


@dataclass
class _Worker:
    """One process that computes columns of maps."""

    variant: str

    def __post_init__(self) -> None:
        activate(self.variant, 1)
        self._limits: dict[int, LimitsOfPushes] = {}

    def column(
        self, on_progress: Callable[[], None], column: MapColumn, information: str
    ) -> list[dict[str, Any]]:
        """Return a row for each deflection at one contact distance."""
        file = column.file
        if column.number not in self._limits:
            limits = LimitsOfPushes(file.scene, rig_of_map(file.scene), file.folder)
            self._limits = {column.number: limits}
        limits = self._limits[column.number]
        length_mm = limits.rig.beam.length / MILLIMETRE
        distance_mm = column.contact_distance_pct * PERCENT * length_mm
        pushed = places(file, limits.rig, distance_mm, column.deflection_pct)
        found = _limits_at(limits, [place for place in pushed if place.state], information)
        rows = []
        for place, deflection in zip(pushed, column.deflection_pct, strict=True):
            row = {
                "contact_distance_mm": distance_mm,
                "contact_distance_pct_L": column.contact_distance_pct,
                "deflection_pct": deflection,
                "information": information,
                "reason": place.reason or None,
            }
            if place.state is not None:
                row |= _values(place, found.get(place.spec.frame_id), length_mm)
            rows.append(row)
        on_progress()
        return rows


def _limits_at(
    limits: LimitsOfPushes, reached: Sequence[Place], information: str
) -> dict[str, dict[str, Any]]:
    """Compute the limits of the reached places of one push, by frame."""
    if not reached:
        return {}
    targets = tuple(place.spec.target for place in reached)
    specs = [
        replace(place.spec, push=replace(place.spec.push, targets=targets), step=step)
        for step, place in enumerate(reached)
    ]
    rows = limits.rows(specs, visible_by_plan)
    return {row["frame_id"]: row for row in rows if row["information"] == information}


def _values(place: Place, limit: dict[str, Any] | None, length_mm: float) -> dict[str, Any]:
    assert place.state is not None
    if limit is None:
        return {"reason": "there is no equilibrium next to this one, from which to derive a limit"}
    force = float(np.linalg.norm(place.state.contact.force))
    values = {name: limit[name] for name in _LIMITS}
    return {
        **values,
        "force_mn": 1e3 * force,
        "x_c_limit_pct_L": _times(values["x_c_limit_mm"], 100 / length_mm),
        "force_limit_mn": _times(values["force_limit_n"], 1e3),
        "force_limit_pct": _times(values["force_limit_n"], 100 / force),
    }


def _times(value: float | None, factor: float) -> float | None:
    return None if value is None else value * factor
