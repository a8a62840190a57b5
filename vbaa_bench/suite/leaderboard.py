"""The leaderboard of a suite: methods and submissions by track, with intervals and ties."""

import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt
import polars as pl

from solver.instrument.arrays import Floats
from solver.instrument.errors import InputError
from vbaa_bench.dataset.collection import rigs_of
from vbaa_bench.dataset.recorded import exists
from vbaa_bench.dataset.splits import check_split
from vbaa_bench.regression.compared import LEAST_RELATIVE_CHANGE_OF_TIME
from vbaa_bench.scene.load import read_model
from vbaa_bench.scoring.bootstrap import Interval, draws, group_numbers, interval
from vbaa_bench.scoring.ranking import FEWEST_GROUPS, by_solve, ranks, statistic_draws
from vbaa_bench.scoring.results_layout import Results
from vbaa_bench.scoring.score import read_scores
from vbaa_bench.suite.figures import ERROR, FIGURES, TIME
from vbaa_bench.suite.folder import SuiteFolder, frames_of
from vbaa_bench.suite.real import scored_sets
from vbaa_bench.suite.specification import Entry
from vbaa_bench.suite.submission import Submission

SOLVER: Final = "method of this package"
OWN: Final = "method of your own"


class Value(NamedTuple):
    """Value of a figure, with its 95 % interval; None: there is none."""

    value: float | None
    interval: Interval | None


@dataclass(frozen=True)
class Place:
    """A method in a track.

    `rank` is by the error of x_c, and `time_rank` by the time over that of the reference kernel;
    None where a method is not ranked. `datasets` are those of the track with its predictions.
    `fresh` is its error on the datasets with a fresh seed; None if it was not run on these.
    """

    method: str
    kind: str
    submission: Submission | None
    rank: int | None
    time_rank: int | None
    datasets: int
    figures: Mapping[str, Value]
    fresh: Value | None


@dataclass(frozen=True)
class TrackTable:
    """A track: its methods by rank.

    `scored` are the names of its datasets that have scores; `pushes` is their number of different
    pushes, or rigs. With fewer than FEWEST_GROUPS, no method is ranked.
    """

    name: str
    about: str
    scored: Sequence[str]
    missing: Sequence[str]
    pushes: int
    frames: int
    places: Sequence[Place]

    def sentence(self) -> str:
        """Name the best methods and the fastest ones: several where they are not distinguished."""
        if self.pushes < FEWEST_GROUPS:
            return (
                f"Methods are not compared: there are fewer than {FEWEST_GROUPS} pushes, or rigs."
            )
        best = [one.method for one in self.places if one.rank == 1]
        fastest = [one.method for one in self.places if one.time_rank == 1]
        parts = [_winners("Most accurate", best), _winners("Fastest", fastest)]
        return " ".join(filter(None, parts)) or "No method is ranked."


class _Scored(NamedTuple):
    """Scores of a dataset, with the group (n,) of each row, and the counts of the draws."""

    rows: pl.DataFrame
    groups: npt.NDArray[np.int64]
    counts: Floats

    @property
    def methods(self) -> list[str]:
        """Names of the methods that are scored."""
        return self.rows["method"].unique(maintain_order=True).to_list()

    def of(self, method: str) -> tuple[pl.DataFrame, npt.NDArray[np.int64]]:
        """Select the rows of a method, and their groups."""
        chosen = (self.rows["method"] == method).to_numpy()
        return self.rows.filter(chosen), self.groups[chosen]


def leaderboard(folder: SuiteFolder) -> list[TrackTable]:
    """Compute the tables of all tracks that have a scored dataset.

    Raises InputError if there is neither one nor a scored real set.
    """
    submissions = {one.run_name: one for one in submissions_of(folder)}
    tables = []
    for name in folder.suite.content.tracks:
        entries = folder.suite.entries((name,))
        scored = {
            entry.name: scores
            for entry in entries
            if (scores := _scored(folder.results(entry), entry)) is not None
        }
        if scored:
            fresh = {
                entry.name: scores
                for entry in entries
                if (scores := _scored(folder.results(entry, fresh=True), entry)) is not None
            }
            tables.append(_table(folder, name, scored, fresh, submissions))
    if not tables and not scored_sets(folder):
        raise InputError(f"{folder.root}: holds no scored dataset of the suite; run it first")
    return tables


def _winners(title: str, names: Sequence[str]) -> str:
    if not names:
        return ""
    if len(names) == 1:
        return f"{title}: {names[0]}."
    return f"{title}, not distinguishable: {', '.join(names[:-1])} and {names[-1]}."


def submissions_of(folder: SuiteFolder) -> Iterator[Submission]:
    """Read the submissions that were run, by name. Raises InputError."""
    for path in sorted(folder.submissions.glob("*.yaml")):
        yield read_model(path, Submission)


def _scored(results: Results, entry: Entry) -> _Scored | None:
    """Read the scores of the frames that count; None if there are none."""
    if not exists(results.scores / "scores.parquet"):
        return None
    rows = read_scores(results)
    if entry.dataset.split is not None:
        rows = rows_of_split(rows, results.root, entry.dataset.split)
    groups = group_numbers(rows, ["rig"] if "rig" in rows.columns else None)
    names, groups = np.unique(groups, return_inverse=True)
    seed = zlib.crc32(entry.key.encode())
    return _Scored(rows, groups, draws(len(names), size=len(names) - 1, seed=seed))


def rows_of_split(rows: pl.DataFrame, root: Path, split: str) -> pl.DataFrame:
    """Select the rows of the scores whose frames are in a split of the dataset or collection.

    Raises InputError if there is no such split.
    """
    frames = pl.concat(
        frames_of(layout).with_columns(rig=pl.lit(layout.root.name.removeprefix("rig_")))
        for layout in rigs_of(root)
    )
    check_split(split, set(frames["split"]), root)
    chosen = frames.filter(pl.col("split") == split)
    keys = ["rig", "frame_id"] if "rig" in rows.columns else ["frame_id"]
    # Numbers of rigs are text in the names of their folders.
    of_split = chosen.select(pl.col(key).cast(rows.schema[key]) for key in keys)
    return rows.join(of_split, on=keys, how="semi", maintain_order="left")


def _table(
    folder: SuiteFolder,
    track: str,
    scored: Mapping[str, _Scored],
    fresh: Mapping[str, _Scored],
    submissions: Mapping[str, Submission],
) -> TrackTable:
    names = dict.fromkeys(name for one in scored.values() for name in one.methods)
    figures = {name: FIGURES[name] for name in folder.suite.content.metrics}
    values = dict[str, dict[str, Value]]()
    resampled = dict[str, dict[str, Floats]]()
    datasets = dict[str, int]()
    for method in names:
        having = [one for one in scored.values() if method in one.methods]
        datasets[method] = len(having)
        values[method], resampled[method] = {}, {}
        for name in figures:
            values[method][name], resampled[method][name] = _figure(name, method, having)
    pushes = sum(one.counts.shape[1] for one in scored.values())
    complete = [name for name in names if pushes >= FEWEST_GROUPS and datasets[name] == len(scored)]
    rank = ranks({n: resampled[n][ERROR] for n in complete if values[n][ERROR].value is not None})
    timed = {
        n: resampled[n][TIME]
        for n in complete
        if TIME in figures and by_solve(n) and values[n][TIME].value is not None
    }
    time_rank = ranks(timed, LEAST_RELATIVE_CHANGE_OF_TIME)
    places = []
    for method in names:
        submission = submissions.get(method)
        again = [one for one in fresh.values() if method in one.methods]
        places.append(
            Place(
                method=method if submission is None else submission.name,
                kind=_kind(method, submission),
                submission=submission,
                rank=rank.get(method),
                time_rank=time_rank.get(method),
                datasets=datasets[method],
                figures=values[method],
                fresh=_figure(ERROR, method, again)[0] if again else None,
            )
        )
    specification = folder.suite.content.tracks[track]
    return TrackTable(
        name=track,
        about=specification.about,
        scored=list(scored),
        missing=[name for name in specification.datasets if name not in scored],
        pushes=pushes,
        frames=sum(
            one.rows.filter(pl.col("method") == one.methods[0]).height for one in scored.values()
        ),
        places=sorted(places, key=_order),
    )


def _order(place: Place) -> tuple[float, float, str]:
    """Sort by rank, error and name; what is not ranked comes last."""
    error = place.figures[ERROR].value
    infinity = float("inf")
    return (
        infinity if place.rank is None else place.rank,
        infinity if error is None else error,
        place.method,
    )


def _kind(method: str, submission: Submission | None) -> str:
    if submission is not None:
        return f"submission, {submission.kind}"
    return SOLVER if by_solve(method) and "." not in method else OWN


def _figure(name: str, method: str, scored: Sequence[_Scored]) -> tuple[Value, Floats]:
    """Compute a figure of a track from its datasets, of those that have it, and its draws.

    A dataset of whose contacts all are rightly refused has no error. A method that never estimates
    x_c has none.
    """
    figure = FIGURES[name]
    points, resampled = [], []
    estimates = (one.of(method)[0]["x_c_error_pct_L"].is_not_null().any() for one in scored)
    if name == ERROR and not any(estimates):
        return Value(None, None), np.full(1, np.nan)
    for one in scored:
        rows, groups = one.of(method)
        point = figure.statistic.of(rows)
        if point is not None:
            points.append(point)
            resampled.append(statistic_draws(figure.statistic, rows, groups, one.counts))
    if not points:
        return Value(None, None), np.full(1, np.nan)
    of_track = figure.of_track(np.array(resampled))
    return Value(float(figure.of_track(np.array(points))), interval(of_track)), of_track
