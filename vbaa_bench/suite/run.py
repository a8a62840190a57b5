"""Run a suite: generate its datasets, compute limits, solve and score; resumed where it ended."""

import contextlib
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Final, NamedTuple

from solver.instrument.errors import DamageError, InputError
from solver.instrument.files import write_bytes
from solver.instrument.observation import open_observations
from solver.methods import METHODS, Method
from solver.methods.by_name import find_method
from vbaa_bench.api import data, results
from vbaa_bench.dataset.collection import count_frames, rigs_of
from vbaa_bench.dataset.derived import read_limits
from vbaa_bench.dataset.lock import writing
from vbaa_bench.dataset.overall_digest import dataset_digest
from vbaa_bench.dataset.recorded import write_results
from vbaa_bench.limits.dataset_limits import Progress, dataset_limits
from vbaa_bench.scoring.isolation.runs import applicable
from vbaa_bench.scoring.predictions import parsed, read_file
from vbaa_bench.scoring.results_layout import Results, run_name
from vbaa_bench.suite.folder import SuiteFolder, frames_of
from vbaa_bench.suite.real import open_set
from vbaa_bench.suite.specification import Entry, load_suite
from vbaa_bench.suite.submission import METHOD_FILE, Submission, read_submission

_ALL_METHODS: Final = "all"


class Request(NamedTuple):
    """What to run; `submissions` and `real` are folders.

    Without tracks it is all of them, or none with real sets; without methods it is all that a
    dataset has readings for. With `fresh`, submissions with code run on fresh datasets, too.
    """

    tracks: tuple[str, ...] = ()
    methods: tuple[str, ...] = ()
    submissions: tuple[Path, ...] = ()
    real: tuple[Path, ...] = ()
    fresh: bool = True
    workers: int | None = None
    variant: str | None = None


class DatasetRun(NamedTuple):
    """A dataset or a real set that was run: name in the suite, folder, number of frames, digest."""

    key: str
    root: Path
    frames: int
    failed_frames: int
    digest: str


class _Code(NamedTuple):
    """A method of a submission, and the folder of its module."""

    method: str
    folder: Path


def run_suite(
    folder: SuiteFolder,
    request: Request,
    on_line: Callable[[str], None],
    on_limits: Progress = lambda _done, _total: None,
) -> Iterator[DatasetRun]:
    """Run the datasets of a suite, one after another; yield each when it is scored.

    What is complete is kept: frames, limits, and predictions of methods; real sets, which come
    first, are solved again. `on_line` receives remarks. With `fresh`, submissions with code are
    also run on datasets with the folder's fresh seed. Raises InputError, for a submission, a method
    or a real set before anything is generated.
    """
    submissions = [(path, read_submission(path)) for path in request.submissions]
    for path, submission in submissions:
        if load_suite(submission.suite).content.version != folder.suite.content.version:
            raise InputError(
                f"{path / METHOD_FILE}: suite is {submission.suite}, allowed is "
                f"{folder.suite.content.version}, that of {folder.root}"
            )
    entries = [] if request.real and not request.tracks else folder.suite.entries(request.tracks)
    for name in _named(request.methods):
        if ":" not in name:
            find_method(name)  # a misspelled name is found before anything is rendered
    sets = [open_set(folder, path) for path in request.real]
    with writing(folder.submissions):
        for path, submission in submissions:
            folder.submissions.mkdir(exist_ok=True)
            target = folder.submissions / f"{submission.name}.yaml"
            write_bytes(target, (path / METHOD_FILE).read_bytes())
    codes = [
        _Code(submission.code, path.resolve())
        for path, submission in submissions
        if submission.code
    ]
    for one in sets:
        names = one.methods(_named(request.methods), on_line)
        own = {run_name(name): _Code(name, Path.cwd()) for name in names}
        sent = {code.method.partition(":")[0]: code for code in codes}
        one.score(_functions(own | sent), on_line)
        loads = len(one.protocol.known)
        yield DatasetRun(f"real/{one.record.stem}", one.root, loads, 0, one.sha256)
    for number, entry in enumerate(entries, 1):
        on_line(f"{entry.key}, dataset {number} of {len(entries)}: {entry.dataset.scene}")
        made = _made(folder, entry, request, on_limits)
        requested = request.methods or tuple(
            applicable(open_observations(rigs_of(made.root)[0].observations))
        )
        _solve(folder, made, [_Code(name, Path.cwd()) for name in _named(requested)], on_line)
        _solve(folder, made, codes, on_line)
        for path, submission in submissions:
            if entry.key in (submission.predictions or {}):
                _copy_predictions(made, path, submission, entry)
        results.score(made.root)
        yield _record(entry.key, made)
        if request.fresh and codes:
            on_line(f"{entry.key}: {entry.dataset.scene}, fresh seed {folder.fresh_seed}")
            fresh = _made(folder, entry, request, on_limits, fresh=True)
            _solve(folder, fresh, codes, on_line)
            results.score(fresh.root)


def _named(methods: Sequence[str]) -> list[str]:
    """List methods by name, each once; "all" is all of the solver."""
    return list(
        dict.fromkeys(
            name for one in methods for name in (METHODS if one == _ALL_METHODS else [one])
        )
    )


def _functions(codes: Mapping[str, _Code]) -> dict[str, Method]:
    """Import methods by name, each from its folder. Raises InputError."""
    sys.path += [str(folder) for folder in {code.folder for code in codes.values()}]
    return {name: find_method(code.method) for name, code in codes.items()}


def _made(
    folder: SuiteFolder,
    entry: Entry,
    request: Request,
    on_limits: Progress,
    *,
    fresh: bool = False,
) -> Results:
    """Generate a dataset, or finish it, and compute its limits unless they are there."""
    file = folder.suite.scene(entry, folder.fresh_seed if fresh else None)
    made, variant = folder.results(entry, fresh=fresh), data.usable_variant(request.variant)
    workers, rigs = request.workers, entry.dataset.rigs
    if rigs is None:
        data.generate(file, made.root, workers=workers, variant=variant, progress=True)
    else:
        data.generate_rigs(
            file, made.root, rigs=range(rigs), workers=workers, variant=variant, progress=True
        )
    for layout in rigs_of(made.root):
        try:
            known = read_limits(layout) is not None
        except DamageError:
            known = False
        if not known:
            dataset_limits(layout.root, variant, data.worker_count(workers, variant), on_limits)
    return made


def _solve(
    folder: SuiteFolder, made: Results, codes: Sequence[_Code], on_line: Callable[[str], None]
) -> None:
    """Run methods that have no predictions of every rig yet."""
    rules = folder.suite.content.rules
    tables = [Results(layout.root).predictions for layout in rigs_of(made.root)]
    for place in dict.fromkeys(code.folder for code in codes):
        missing = [
            code.method
            for code in codes
            if code.folder == place
            and not all((table / f"{run_name(code.method)}.csv").is_file() for table in tables)
        ]
        if missing:
            # A module is searched in the current folder.
            with contextlib.chdir(place):
                results.solve(
                    made.root,
                    missing,
                    repeats=rules.repeats,
                    memory_gb=rules.memory_gb,
                    on_start=lambda names: on_line(f"solving with {names}"),
                    on_output=on_line,
                )


def _copy_predictions(made: Results, path: Path, submission: Submission, entry: Entry) -> None:
    """Copy the predictions of a submission into the folder of each rig that has frames in them."""
    assert submission.predictions is not None
    file = path / submission.predictions[entry.key]
    content = read_file(file)
    suffix = ".parquet" if file.suffix.lower() == ".parquet" else ".csv"
    other = {".csv": ".parquet", ".parquet": ".csv"}[suffix]
    if entry.dataset.rigs is None:
        files = {f"{submission.name}{suffix}": content}
        write_results(made.predictions, files, [f"{submission.name}{other}"])
        return
    table = parsed(content, file)
    if "frame_id" not in table.columns:
        raise InputError(f"{file}: the column frame_id is missing")
    for layout in rigs_of(made.root):
        rows = table.filter(table["frame_id"].is_in(frames_of(layout)["frame_id"].to_list()))
        files = {f"{submission.name}.csv": rows.write_csv().encode()}
        write_results(Results(layout.root).predictions, files, [f"{submission.name}.parquet"])


def _record(key: str, made: Results) -> DatasetRun:
    counts = count_frames(made.root)
    return DatasetRun(
        key, made.root, counts.frames, counts.failed_frames, dataset_digest(made.root)
    )
