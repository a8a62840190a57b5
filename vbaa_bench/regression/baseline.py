"""Baseline files: the errors of every frame of a run, and how they have changed over time.

A baseline is JSON with one column per line, so that it is small and its changes can be read:
`title`, `scene`, `images` and `processor` as in ScoredRun; `frames`, the columns that all methods
share; `methods`, the columns of each; and `history`, one entry per version of the baseline with
`why` it was written and the `typical` value of every quantity and method.
"""

import json
from pathlib import Path
from typing import Annotated, Any, Final, NamedTuple

import polars as pl
from pydantic import Field

from solver.instrument.errors import InputError, quoted, truncated
from solver.instrument.files import write_text
from vbaa_bench.dataset.column import Kind
from vbaa_bench.dataset.document import Document, Figure, check_document, read_json
from vbaa_bench.dataset.tables import Schema, checked
from vbaa_bench.regression.compared import COMPARED
from vbaa_bench.regression.scored_run import PARAMETERS, PLACE, RESULTS, TEXTS, ScoredRun

# Version of the format.
_FORMAT: Final = 1
_FIRST: Final = "first baseline"
_STRINGS: Final = (*TEXTS, "outcome")


class Baseline(NamedTuple):
    """Baseline file: the run that it holds, and its history, the latest entry last."""

    run: ScoredRun
    history: list[dict[str, Any]]


class Revised(NamedTuple):
    """Typical value of a method before and after a new version of a baseline; None if it had none.

    `quantity` is the label of the quantity, `unit` that of both values.
    """

    method: str
    quantity: str
    unit: str
    old: float | None
    new: float | None


class Version(NamedTuple):
    """Version of a baseline: why it was written, and the values that differ from those before."""

    why: str
    revised: list[Revised]


def write_baseline(run: ScoredRun, path: Path, why: str | None = None) -> None:
    """Write a run as a baseline; `why` states why an existing one is replaced.

    Raises InputError without a reason, for a baseline of another scene, and if `path` cannot be
    written.
    """
    history: list[dict[str, Any]] = []
    if path.exists():
        if not (why or "").strip():
            raise InputError(f"{path}: exists; state with --why why it is replaced")
        previous = read_baseline(path)
        check_same_scene(previous.run, run, path)
        history = previous.history
    document = {
        "format": _FORMAT,
        "title": run.title,
        "scene": run.scene,
        "images": run.images,
        "processor": run.processor,
        "history": [*history, {"why": why or _FIRST, "typical": _typical(run)}],
        **_columns(run),
    }
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_text(path, _text(document) + "\n")
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror})") from error


def read_baseline(path: Path) -> Baseline:
    """Read a baseline. Raises InputError if it is not one."""
    document = read_json(path)
    if document.get("format") != _FORMAT:
        raise InputError(
            f"{path}: format is {quoted(document.get('format'))}, allowed is {_FORMAT}; "
            "write it with vbaa-bench compare RUN FILE --save"
        )
    baseline = check_document(path, document, _Document)
    try:
        tables = [
            pl.DataFrame(
                {**baseline.frames, **dict.fromkeys(RESULTS), **values, "method": name},
                schema_overrides={name: kind.dtype for name, kind in _KINDS.items()},
            )
            for name, values in baseline.methods.items()
        ]
        frames = pl.concat([table.select(list(_KINDS)) for table in tables])
    except (TypeError, ValueError, OverflowError, pl.exceptions.PolarsError) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise InputError(f"{path}: is not a baseline ({truncated(reason)})") from error
    run = ScoredRun(
        baseline.title,
        baseline.scene,
        baseline.images,
        baseline.processor,
        checked(frames.drop_nulls("outcome"), _SCHEMA, str(path)),
    )
    return Baseline(run, document["history"])


def check_same_scene(old: ScoredRun, new: ScoredRun, path: Path) -> None:
    """Raise InputError if a run's scene is not that of the baseline at `path`."""
    keys = sorted(old.scene.keys() | new.scene.keys())
    different = [key for key in keys if old.scene.get(key) != new.scene.get(key)]
    if different:
        raise InputError(
            f"{path}: is of another scene than the run, {quoted(old.title)} and "
            f"{quoted(new.title)}; {truncated(different[0])} differs"
        )


def versions(baseline: Baseline) -> list[Version]:
    """List the versions of a baseline, oldest first, each with the values that it changed."""
    listed = []
    before: dict[str, dict[str, float]] = {}
    for entry in baseline.history:
        after: dict[str, dict[str, float]] = entry["typical"]
        revised = [
            Revised(
                method,
                quantity.label,
                quantity.unit,
                before.get(method, {}).get(quantity.column),
                after.get(method, {}).get(quantity.column),
            )
            for method in [*after, *(before.keys() - after.keys())]
            for quantity in COMPARED
        ]
        listed.append(Version(entry["why"], [one for one in revised if one.old != one.new]))
        before = after
    return listed


_KINDS: Final = {
    name: Kind.INTEGER if name in PLACE else Kind.TEXT if name in _STRINGS else Kind.NUMBER
    for name in (*PLACE, *PARAMETERS, *RESULTS)
} | {"method": Kind.TEXT}
_SCHEMA: Final = Schema(
    _KINDS,
    required=(*PLACE, "push", "method"),
    finite=[name for name, kind in _KINDS.items() if kind is Kind.NUMBER],
)


class _Entry(Document):
    why: str
    typical: dict[str, dict[str, Figure]]


class _Document(Document):
    """Keys of a baseline file, see above."""

    title: str
    scene: dict[str, Any]
    images: str
    processor: str
    frames: dict[str, list[Any]]
    methods: Annotated[dict[str, dict[str, list[Any]]], Field(min_length=1)]
    history: list[_Entry]


def _columns(run: ScoredRun) -> dict[str, Any]:
    """Split a run's frames into the columns that all methods share and those of each method."""
    shared = run.frames.select(*PLACE, *PARAMETERS).unique(PLACE).sort(PLACE)
    methods = {}
    for name in run.methods:
        rows = shared.select(PLACE).join(
            run.frames.filter(method=name), on=PLACE, how="left", maintain_order="left"
        )
        methods[name] = {
            column: rows[column].to_list() for column in RESULTS if rows[column].is_not_null().any()
        }
    return {"frames": shared.to_dict(as_series=False), "methods": methods}


def _typical(run: ScoredRun) -> dict[str, dict[str, float]]:
    """Compute the typical value of every quantity of each method, to four digits."""
    typical: dict[str, dict[str, float]] = {method: {} for method in run.methods}
    for quantity in COMPARED:
        rows = run.frames.drop_nulls(quantity.column)
        pushes = rows.group_by("method", "rig", "push_id", maintain_order=True).agg(
            value=quantity.of_push(quantity.column)
        )
        for (method,), values in pushes.group_by("method", maintain_order=True):
            value = quantity.of_set(values["value"].to_numpy())
            typical[str(method)][quantity.column] = float(f"{value:.4g}")
    return typical


def _text(value: Any, indent: str = "") -> str:
    """Format a value as JSON, with each list of plain values on one line."""
    inner = indent + " "
    if isinstance(value, dict) and any(isinstance(part, dict | list) for part in value.values()):
        items = [f"{json.dumps(name)}: {_text(part, inner)}" for name, part in value.items()]
        opening, closing = "{", "}"
    elif isinstance(value, list) and any(isinstance(part, dict) for part in value):
        items = [_text(part, inner) for part in value]
        opening, closing = "[", "]"
    else:
        return json.dumps(value, separators=(",", ":"))
    return f"{opening}\n{inner}" + f",\n{inner}".join(items) + f"\n{indent}{closing}"
