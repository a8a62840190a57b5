"""The folder of a run of a suite.

FOLDER/
  suite.json                   the suite, the sha256 of its file, and the seed of fresh datasets
  tracks/<track>/<dataset>/    datasets and collections, with their predictions and scores
  fresh/<track>/<dataset>/     the same scenes with the fresh seed, for submissions with code
  submissions/<name>.yaml      method.yaml of every submission that was run
  real/<set>.json              scores on a real set, see real.py
  leaderboard.html, .csv       see page.py; real.csv if there are real sets
"""

import json
import secrets
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import polars as pl

from solver.instrument.errors import InputError
from solver.instrument.files import write_text
from vbaa_bench.dataset.copies import complete_table
from vbaa_bench.dataset.document import Document, check_document, read_json
from vbaa_bench.dataset.layout import Layout, shard_numbers
from vbaa_bench.dataset.lock import writing
from vbaa_bench.dataset.splits import read_splits
from vbaa_bench.scoring.results_layout import Results
from vbaa_bench.suite.specification import Entry, Suite, load_suite

_RECORD: Final = "suite.json"


class _Record(Document):
    suite: str
    sha256: str
    fresh_seed: int


@dataclass(frozen=True)
class SuiteFolder:
    """A folder with the datasets and results of a suite; `root` is a full path."""

    root: Path
    suite: Suite
    fresh_seed: int

    def results(self, entry: Entry, *, fresh: bool = False) -> Results:
        """Return the paths of a dataset of the suite, or of the same scene with a fresh seed."""
        kind = "fresh" if fresh else "tracks"
        return Results(self.root / kind / entry.track / entry.name)

    @property
    def submissions(self) -> Path:
        """The folder of the submissions that were run."""
        return self.root / "submissions"

    @property
    def real(self) -> Path:
        """The folder of the scores on real sets."""
        return self.root / "real"

    def entries_made(self) -> list[Entry]:
        """List the datasets of the suite that are in the folder, complete or not."""
        return [entry for entry in self.suite.entries() if self.results(entry).root.is_dir()]


def frames_of(layout: Layout) -> pl.DataFrame:
    """Tabulate `frame_id` and `split` of all frames of a dataset. Raises InputError."""
    numbers = shard_numbers(complete_table(layout.observations))
    return pl.concat([read_splits(layout, number) for number in numbers])


def create_folder(root: Path, name: str) -> SuiteFolder:
    """Make the folder of a suite, or open it if it exists; `name` is as `load_suite` takes it.

    Raises InputError if it is that of another suite, or cannot be written.
    """
    suite = load_suite(name)
    stated = str(suite.path.resolve()) if name.endswith(".yaml") else name
    if not (root / _RECORD).is_file():
        record = _Record(suite=stated, sha256=suite.sha256, fresh_seed=secrets.randbits(48))
        with writing(root):
            root.mkdir(parents=True, exist_ok=True)
            write_text(root / _RECORD, json.dumps(record.model_dump(), indent=1) + "\n")
    folder = open_folder(root)
    if folder.suite.content.version != suite.content.version:
        raise InputError(
            f"{root}: holds the suite {folder.suite.content.version}, not "
            f"{suite.content.version}; choose another folder with --out"
        )
    return folder


def open_folder(root: Path) -> SuiteFolder:
    """Open the folder of a run. Raises InputError if it is none, or the suite has changed since."""
    path = root / _RECORD
    if not path.is_file():
        raise InputError(f"{root}: is no folder of a suite; make one with vbaa-bench suite run")
    record = check_document(path, read_json(path), _Record)
    suite = load_suite(record.suite)
    if suite.sha256 != record.sha256:
        raise InputError(
            f"{path}: the suite {suite.content.version} has changed since this folder was made; "
            "choose another folder with --out"
        )
    return SuiteFolder(root.resolve(), suite, record.fresh_seed)
