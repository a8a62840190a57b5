"""A large dataset made of copies of a small one that was solved, to measure speed and memory.

In each copy, frames and pushes have other names, contact distances at rest are drawn anew, so that
there are as many different pushes as in a random scene, and estimates are perturbed. Images are
hard links; truth layers are left out.
"""

import io
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
import polars as pl

from solver.instrument.errors import InputError
from solver.instrument.hashes import HASHES, digest, hashes_bytes, read_bytes, read_hashes
from vbaa_bench.dataset.derived import read_limits, write_limits
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.readers import open_truth
from vbaa_bench.scoring.results_layout import Results
from vbaa_bench.scoring.score import found_predictions

# Largest shift of a contact distance at rest [mm]. Chosen: half the step of the paper's scenes.
_SHIFT_MM: Final = 10.0
# Relative standard deviation by which estimates are perturbed. Chosen: that of exact_fit.
_PERTURBED: Final = 1e-4


class _Copy(NamedTuple):
    """One copy: new names of frames and pushes by the old ones, and shifts of pushes [mm]."""

    names: dict[str, str]
    shifts_mm: dict[str, float]

    def renamed(self, table: pl.DataFrame) -> pl.DataFrame:
        """Replace the names in a table's columns frame_id and push_id."""
        columns = [name for name in ("frame_id", "push_id") if name in table.columns]
        return table.with_columns(pl.col(columns).replace_strict(self.names))


def enlarge(source: Path, target: Path, frames: int, methods: Sequence[str] = ()) -> list[str]:
    """Write whole copies of a solved dataset with at least `frames` frames into a new folder.

    Return the names of the copied methods, by default all. Raises InputError for a method without
    predictions.
    """
    small, large = Results(source), Results(target)
    truth = open_truth(small.dataset.truth, centrelines=False).frames
    predictions = found_predictions(small)
    absent = [name for name in methods if name not in predictions]
    if absent or not predictions:
        missing = ", ".join(absent) or "any method"
        raise InputError(f"{small.predictions}: holds no predictions of {missing}")
    rng = np.random.default_rng(0)
    copies = [_drawn_copy(truth, number, rng) for number in range(-(-frames // truth.height))]
    _copy_trees(small.dataset, large.dataset, copies)
    large.predictions.mkdir()
    for name in methods or predictions:
        table = pl.read_csv(predictions[name], infer_schema_length=None)
        estimates = pl.concat(copy.renamed(table) for copy in copies)
        factors = rng.normal(1, _PERTURBED, estimates.height)
        perturbed = (
            pl.col(column).cast(pl.Float64) * pl.Series(factors)
            for column in ("x_c_mm", "s_c_mm", "force_n", "psi_deg")
            if column in table.columns
        )
        estimates.with_columns(perturbed).write_csv(large.predictions / f"{name}.csv")
    limits = read_limits(small.dataset)
    if limits is not None:
        write_limits(large.dataset, pl.concat(copy.renamed(limits) for copy in copies))
    return list(methods or predictions)


def _drawn_copy(truth: pl.DataFrame, number: int, rng: np.random.Generator) -> _Copy:
    pushes = truth["push_id"].unique(maintain_order=True).to_list()
    shifts = rng.uniform(-_SHIFT_MM, _SHIFT_MM, len(pushes)).tolist()
    old = [*truth["frame_id"], *pushes]
    names = {name: digest(f"{number} {name}".encode())[:16] for name in old}
    return _Copy(names, dict(zip(pushes, shifts, strict=True)))


def _copy_trees(small: Layout, large: Layout, copies: Sequence[_Copy]) -> None:
    """Write both trees with their hashes: single files once, each shard once per copy."""
    shards = sorted(path.name for path in small.truth.glob("shard_*"))
    hashes: dict[str, dict[str, str]] = {}
    for tree, copied in zip(small.trees, large.trees, strict=True):
        recorded = read_hashes(tree) or {}
        hashes[tree.name] = {
            name: recorded[name] for name in recorded if not name.startswith("shard_")
        }
        for name in hashes[tree.name]:
            (copied / name).parent.mkdir(parents=True, exist_ok=True)
            (copied / name).write_bytes(read_bytes(tree / name))
    for i, copy in enumerate(copies):
        for number, name in enumerate(shards, i * len(shards)):
            sources = [tree / name for tree in small.trees]
            targets = [large.shard(tree, number) for tree in large.trees]
            for source, target, write in zip(
                sources, targets, (_copy_truth, _copy_observations), strict=True
            ):
                target.mkdir()
                table = hashes_bytes(write(source, target, copy))
                (target / HASHES).write_bytes(table)
                hashes[target.parent.name][f"{target.name}/{HASHES}"] = digest(table)
    for tree in large.trees:
        (tree / HASHES).write_bytes(hashes_bytes(hashes[tree.name]))


def _copy_truth(source: Path, target: Path, copy: _Copy) -> dict[str, str]:
    """Write the truth of a shard's copy; return the hashes of its files by name."""
    table = pl.read_parquet(io.BytesIO(read_bytes(source / "truth.parquet")))
    shift = pl.col("push_id").replace_strict(copy.shifts_mm, return_dtype=pl.Float64)
    shifted = table.with_columns(pl.col("contact_distance_at_rest_mm") + shift)
    data = io.BytesIO()
    copy.renamed(shifted).write_parquet(data)
    (target / "truth.parquet").write_bytes(data.getvalue())
    return {"truth.parquet": digest(data.getvalue())}


def _copy_observations(source: Path, target: Path, copy: _Copy) -> dict[str, str]:
    """Write the readings of a shard's copy and link its images; return the hashes by name."""
    recorded = read_hashes(source) or {}
    table = pl.read_csv(read_bytes(source / "metadata.csv"), infer_schema=False)
    hashes = {}
    for frame_id in table["frame_id"]:
        name = f"{copy.names[frame_id]}.png"
        os.link(source / f"{frame_id}.png", target / name)
        hashes[name] = recorded[f"{frame_id}.png"]
    renamed = copy.renamed(table).with_columns(file_name=pl.col("frame_id") + ".png")
    data = renamed.select(table.columns).write_csv().encode()
    (target / "metadata.csv").write_bytes(data)
    return hashes | {"metadata.csv": digest(data)}
