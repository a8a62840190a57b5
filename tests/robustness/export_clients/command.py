"""Export datasets, and check the exports with the client libraries themselves, offline."""

import json
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Final, NamedTuple

from solver.instrument.errors import InputError, truncated
from solver.instrument.images import read_grey
from tests.robustness.export_clients import clients
from tests.robustness.export_clients.clients.check import pixel_digest
from tests.robustness.export_clients.environments import environment, offline
from vbaa_bench.exports.columns import SHARD
from vbaa_bench.exports.croissant import write_croissant
from vbaa_bench.exports.export import export
from vbaa_bench.exports.source import Source, open_source
from vbaa_bench.scoring.tables import markdown_table

# Client -> its environment.
_ENVIRONMENTS: Final = {
    "hf": "clients",
    "webdataset": "clients",
    "croissant": "clients",
    "lerobot": "lerobot",
}


class Row(NamedTuple):
    """One check: what is asked, of which client and dataset, and the answer."""

    dataset: str
    client: str
    asked: str
    expected: str
    measured: str
    right: bool


class _Trial(NamedTuple):
    """One export and the client that reads it; files of `most_bytes`, or of the usual size."""

    label: str
    client: str
    to: str | None
    most_bytes: int | None = None


# Several files per split even in the smallest dataset: a frame has 4 kB or more.
_SMALL_FILE: Final = 20_000
_TRIALS: Final = (
    _Trial("datasets", "hf", "hf"),
    _Trial("datasets, many files", "hf", "hf", _SMALL_FILE),
    _Trial("webdataset", "webdataset", "webdataset"),
    _Trial("webdataset, many files", "webdataset", "webdataset", _SMALL_FILE),
    _Trial("lerobot", "lerobot", "lerobot"),
    _Trial("lerobot, many files", "lerobot", "lerobot", _SMALL_FILE),
    _Trial("mlcroissant, canonical files", "croissant", None),
    _Trial("mlcroissant, hf", "croissant", "hf"),
)


def check_exports(
    datasets: Sequence[Path], environments: Path, progress: Callable[[str, int, int], None]
) -> list[Row]:
    """Export every dataset to every format, and check each export with its client.

    `environments` is the folder of the clients' environments, which are installed once (6 GB, for
    PyTorch). croissant.json is written into the datasets. Raises InputError.
    """
    pythons = {}
    for number, name in enumerate(sorted(set(_ENVIRONMENTS.values()))):
        progress("environments", number, 2)
        pythons[name] = environment(name, environments).python
    progress("environments", 2, 2)
    rows: list[Row] = []
    for i, dataset in enumerate(datasets):
        source = open_source(dataset)
        with tempfile.TemporaryDirectory() as folder:
            expected = Path(folder) / "expected.jsonl"
            expected.write_text("".join(_expected(source)), encoding="utf-8")
            for j, trial in enumerate(_TRIALS):
                progress("exports", i * len(_TRIALS) + j, len(datasets) * len(_TRIALS))
                python = pythons[_ENVIRONMENTS[trial.client]]
                rows += _checks(dataset, trial, Path(folder) / str(j), expected, python)
    progress("exports", len(datasets) * len(_TRIALS), len(datasets) * len(_TRIALS))
    return rows


def _checks(
    dataset: Path, trial: _Trial, folder: Path, expected: Path, python: Path
) -> Iterator[Row]:
    name = dataset.name
    try:
        if trial.to is None:
            folder = write_croissant(dataset).parent
        else:
            export(dataset, trial.to, folder, lambda *_: None, most_bytes=trial.most_bytes)
    except InputError as error:
        reason = str(error).partition(": ")[2]
        yield Row(name, trial.label, "refusal", "one sentence", reason, True)
        return
    done = _read_by_client(python, trial.client, folder, expected)
    if done.returncode:
        message = truncated(done.stderr.strip().rpartition("\n")[2])
        yield Row(name, trial.label, "no error", "none", message, False)
        return
    for check in json.loads(done.stdout.splitlines()[-1]):
        yield Row(name, trial.label, **check)


def _read_by_client(
    python: Path, client: str, folder: Path, expected: Path
) -> subprocess.CompletedProcess[str]:
    """Run a client on an export, in a home of its own with nothing of vbaa_bench but clients/."""
    package = clients.__name__
    command = [str(python), "-m", package, client, str(folder.resolve()), str(expected)]
    with tempfile.TemporaryDirectory() as home:
        copy = shutil.copytree(Path(clients.__file__).parent, Path(home, *package.split(".")))
        # Regular packages: a folder without this file would come after one on Python's path.
        for parent in list(copy.parents)[: package.count(".")]:
            (parent / "__init__.py").touch()
        return subprocess.run(
            command, cwd=home, capture_output=True, text=True, check=False, env=offline(Path(home))
        )


def _expected(source: Source) -> Iterator[str]:
    """Describe each frame, read from the dataset itself: columns, and sha256 of its pixels."""
    for row in source.rows(source.index).iter_rows(named=True):
        image = read_grey(source.rigs[row["rig"]].image_path(row[SHARD], row["frame_id"]))
        frame = {
            "key": source.key(row["rig"], row["frame_id"]),
            **{name: row[name] for name in ("frame_id", "rig", "split", "push_id")},
            "motor_angle_deg": row["motor_angle_deg"],
            "dtype": str(image.dtype),
            "pixels": pixel_digest(image),
            "columns": {name: value for name, value in row.items() if name != SHARD},
        }
        yield json.dumps(frame) + "\n"


def as_markdown(rows: Sequence[Row]) -> str:
    """Write the checks as a table."""
    heads = ("dataset", "client", "asked", "expected", "measured", "")
    lines = (
        (one.dataset, one.client, one.asked, one.expected, one.measured, _verdict(one))
        for one in rows
    )
    return markdown_table(heads, lines, range(len(heads))) + "\n"


def _verdict(row: Row) -> str:
    return "right" if row.right else "**wrong**"
