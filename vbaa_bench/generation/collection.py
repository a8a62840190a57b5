"""Generation of a collection: many random rigs of one scene, each a dataset in one folder."""

import gc
import json
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import polars as pl

from solver.instrument.errors import InputError
from solver.instrument.files import write_bytes
from vbaa_bench.dataset.collection import CollectionLayout
from vbaa_bench.dataset.lock import locked
from vbaa_bench.dataset.manifest import read_json
from vbaa_bench.generation.generate import generate
from vbaa_bench.generation.plan import accepted_rig
from vbaa_bench.generation.workers import Pool, cores
from vbaa_bench.scene.frames import Frames
from vbaa_bench.scene.load import SceneFile

Progress = Callable[[int, int], None]


class RigResult(NamedTuple):
    """A rig's number, scene and reason why it could not be generated, empty if it could."""

    number: int
    file: SceneFile | None
    reason: str


def generate_collection(
    file: SceneFile,
    root: Path,
    variant: str,
    workers: int,
    progress: Progress,
    numbers: Sequence[int] | None = None,
) -> list[RigResult]:
    """Generate the rigs of a collection at `root`, or finish them; return one result per rig.

    `numbers` are those of the rigs to make, by default all. A rig that is impossible is recorded
    with the reason. Raises InputError for a folder that holds another collection or other files,
    or cannot be written.
    """
    layout = CollectionLayout(root)
    numbers = range(file.rigs or 1) if numbers is None else numbers
    try:
        root.mkdir(parents=True, exist_ok=True)
        with locked(root / ".lock"):
            _check_scene(layout, file)
            drawn = [_drawn(file, number) for number in numbers]
            results = _generate(layout, drawn, variant, workers, progress)
            _write_table(layout, file, results)
    except OSError as error:
        raise InputError(f"{root}: cannot be written ({error.strerror or error})") from error
    return results


def _check_scene(layout: CollectionLayout, file: SceneFile) -> None:
    """Write collection.json, unless it exists; raise InputError if it is of another scene."""
    data = (json.dumps(file.template, indent=2) + "\n").encode()
    if not layout.scene.is_file():
        others = [path.name for path in layout.root.iterdir() if path.name != ".lock"]
        if others:
            raise InputError(f"{layout.root}: holds other files ({others[0]}); choose another")
    elif (old := read_json(layout.scene)) != (new := json.loads(data)):
        size = {"rigs", "title"}
        keys = [k for k in sorted(old.keys() | new.keys()) if old.get(k) != new.get(k)]
        changed = [key for key in keys if key not in size]
        if changed:
            raise InputError(
                f"{layout.root}: holds the collection of another scene ({changed[0]} differs); "
                "choose another folder with --out, or delete this one"
            )
        if old.get("rigs", 0) > new.get("rigs", 0):  # a smaller part of it
            return
    write_bytes(layout.scene, data)


def _drawn(file: SceneFile, number: int) -> RigResult:
    try:
        return RigResult(number, accepted_rig(file, number), "")
    except InputError as error:
        return RigResult(number, None, str(error))


def _generate(
    layout: CollectionLayout,
    drawn: Sequence[RigResult],
    variant: str,
    workers: int,
    progress: Progress,
) -> list[RigResult]:
    jobs, total = list[tuple[str, tuple[Any, ...]]](), 0
    for result in drawn:
        if result.file is not None:
            scene = result.file.scene
            # One more than the images: the exposure is metered on an image that is not kept.
            total += Frames(scene).count + scene.calibration.views + scene.sensor.rest_images + 1
            jobs.append(("rig", (result.file, layout.rig(result.number).root)))
    threads = max(cores() // workers, 1)
    with Pool(workers, RigGenerator, (variant, threads)) as pool:
        reasons = iter(pool.run(jobs, lambda done: progress(done, total)))
    return [
        result if result.file is None else result._replace(reason=next(reasons)) for result in drawn
    ]


class RigGenerator:
    """One worker's generator of whole rigs."""

    def __init__(self, variant: str, threads: int) -> None:
        self._variant, self._threads = variant, threads

    def rig(self, tick: Callable[[], None], file: SceneFile, root: Path) -> str:
        """Generate a rig's dataset in this process; return why it is impossible, or nothing."""
        finished = 0

        def progress(done: int, _total: int) -> None:
            nonlocal finished
            for _ in range(done - finished):
                tick()
            finished = done

        try:
            generate(file, root, self._variant, 0, progress, threads=self._threads)
        except InputError as error:
            return str(error)
        finally:
            gc.collect()  # a world and its renderer refer to each other
        return ""


def _write_table(layout: CollectionLayout, file: SceneFile, results: Sequence[RigResult]) -> None:
    """Write rigs.csv; rigs of earlier calls keep their rows."""
    rows = {result.number: rig_row(file, result) for result in results}
    if layout.table.is_file():
        old = pl.read_csv(layout.table, infer_schema=False).to_dicts()
        rows = {int(row["rig"]): row for row in old} | rows
    layout.write_rows(rows)


def rig_row(file: SceneFile, result: RigResult) -> dict[str, str | None]:
    """Collect the row of a rig in rigs.csv: texts, None for an empty cell."""
    row: dict[str, Any] = {"rig": result.number, "reason": result.reason or None}
    if result.file is not None:
        row |= {"seed": result.file.scene.seed, **file.rig_values(result.file.scene)}
    return {name: None if value is None else str(value) for name, value in row.items()}


def failed(results: Sequence[RigResult]) -> Iterator[str]:
    """Yield a sentence for each rig that could not be generated."""
    for result in results:
        if result.reason:
            yield f"rig {result.number} cannot be generated: {result.reason}"
