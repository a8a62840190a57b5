"""Cells of the table of changes: a method's quantity in one stratum of one scene, or of all."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
import polars as pl

from solver.instrument.arrays import Floats
from vbaa_bench.regression.compared import COMPARED, TIME, ComparedQuantity
from vbaa_bench.regression.permutation_test import ChangeTable
from vbaa_bench.scoring.strata import ALL, compared_strata

ALL_SCENES: Final = "all scenes"
# Derived: all of n pushes change alike by chance with a probability of 2 / 2^n, which has to be
# well below the 0.8 % of false alarms.
_FEWEST_PUSHES: Final = 9
# Fraction of the variance of a push's change that all pushes of a dataset share in addition, if the
# images are others. Measured: 0.03 to 0.09 for errors of exact methods, see
# results/regression/README.md; at 0, two in three comparisons of 90 unchanged pushes alarm.
_SHARED_VARIANCE: Final = 0.1


@dataclass(frozen=True)
class PairedScene:
    """Paired frames of one scene, as `pair` returns them.

    `same_images` is true if run and baseline solved the same images, `same_processor` if their
    times can be compared. `rigs` is true of a collection, whose independent unit is the rig.
    """

    name: str
    frames: pl.DataFrame
    same_images: bool
    same_processor: bool
    rigs: bool


@dataclass(frozen=True)
class Cell:
    """Cell of the table: values of its pushes, on the scale of `ComparedQuantity.of_push`.

    `units` (n,) are names of the pushes, unique in the whole table; `old` and `new` (n,) are their
    values, and `frames` is the number of paired frames. `shared_sigma` is the standard deviation of
    the change that all pushes have in common.
    """

    scene: str
    method: str
    quantity: ComparedQuantity
    stratum: str
    units: tuple[str, ...]
    old: Floats
    new: Floats
    frames: int
    shared_sigma: float


def cells(scenes: Mapping[str, PairedScene]) -> list[Cell]:
    """List the cells of all scenes with at least nine pushes, and those of all scenes together."""
    listed = [cell for scene in scenes.values() for cell in _of_scene(scene)]
    if len(scenes) > 1:
        listed += _of_all_scenes([cell for cell in listed if cell.stratum == ALL])
    return [cell for cell in listed if len(cell.units) >= _FEWEST_PUSHES]


def change_table(listed: list[Cell]) -> ChangeTable:
    """Arrange the changes of cells for the test."""
    rows = {unit: n for n, unit in enumerate(dict.fromkeys(u for c in listed for u in c.units))}
    groups = {key: n for n, key in enumerate(dict.fromkeys(map(_group, listed)))}
    matrix = np.full((len(rows), len(listed)), np.nan)
    for column, cell in enumerate(listed):
        matrix[[rows[unit] for unit in cell.units], column] = cell.new - cell.old
    return ChangeTable(
        matrix,
        np.array([cell.shared_sigma for cell in listed]),
        np.array([groups[_group(cell)] for cell in listed]),
    )


def _group(cell: Cell) -> tuple[str, str, str]:
    return cell.scene, cell.method, cell.quantity.column


def _of_scene(scene: PairedScene) -> list[Cell]:
    unit = pl.col("rig").cast(pl.String) if scene.rigs else pl.col("push_id")
    frames, strata = compared_strata(
        scene.frames.with_columns(unit=pl.lit(f"{scene.name} ") + unit)
    )
    listed = []
    for quantity in COMPARED:
        if quantity is TIME and not scene.same_processor:
            continue
        old, new = quantity.column, f"{quantity.column}_new"
        values = frames.drop_nulls([old, new])
        if values.is_empty():
            continue
        for stratum in strata[:1] if quantity is TIME else strata:
            pushes = (
                values.drop_nulls(stratum)
                .group_by("method", stratum, "unit")
                .agg(old=quantity.of_push(old), new=quantity.of_push(new), frames=pl.len())
            )
            parts = pushes.sort("method", stratum, "unit").partition_by(
                "method", stratum, as_dict=True
            )
            listed += [
                _cell(scene, str(method), quantity, str(label), part)
                for (method, label), part in parts.items()
            ]
    return listed


def _cell(
    scene: PairedScene, method: str, quantity: ComparedQuantity, stratum: str, rows: pl.DataFrame
) -> Cell:
    old, new = rows["old"].to_numpy(), rows["new"].to_numpy()
    shared = quantity.shared_sigma
    if quantity is not TIME:
        spread = float(np.std(new - old))
        independent = scene.same_images or scene.rigs
        shared = 0.0 if independent else float(np.hypot(shared, np.sqrt(_SHARED_VARIANCE) * spread))
    units = tuple(rows["unit"])
    frames = int(rows["frames"].sum())
    return Cell(scene.name, method, quantity, stratum, units, old, new, frames, shared)


def _of_all_scenes(listed: list[Cell]) -> list[Cell]:
    """Join the cells of one method and quantity over all scenes."""
    groups: dict[tuple[str, str], list[Cell]] = {}
    for cell in listed:
        groups.setdefault((cell.method, cell.quantity.column), []).append(cell)
    joined = []
    for (method, _), parts in groups.items():
        counts = np.array([len(part.units) for part in parts])
        sigmas = np.array([part.shared_sigma for part in parts])
        shared = float(np.linalg.norm(counts * sigmas) / counts.sum())
        joined.append(
            Cell(
                ALL_SCENES,
                method,
                parts[0].quantity,
                ALL,
                tuple(unit for part in parts for unit in part.units),
                np.concatenate([part.old for part in parts]),
                np.concatenate([part.new for part in parts]),
                sum(part.frames for part in parts),
                shared,
            )
        )
    return [cell for cell in joined if len(cell.units) > _most_pushes(listed, cell)]


def _most_pushes(listed: list[Cell], cell: Cell) -> int:
    """Count the pushes of the largest cell of the same method and quantity in a single scene."""
    return max(
        len(part.units)
        for part in listed
        if (part.method, part.quantity) == (cell.method, cell.quantity)
    )
