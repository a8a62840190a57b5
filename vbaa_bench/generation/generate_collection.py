"""Generation of a collection: many random rigs of one scene, each a dataset in one folder."""

import gc
import shutil
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from solver.instrument.errors import DamageError, InputError
from vbaa_bench.assembly.impossible import check_files
from vbaa_bench.assembly.plan import accepted_rig
from vbaa_bench.dataset.collection import CollectionLayout
from vbaa_bench.dataset.document import read_json
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.lock import FolderError, locked, writing
from vbaa_bench.dataset.scene_files import copy_files, file_digests
from vbaa_bench.generation.deaths import Deaths, ImageError
from vbaa_bench.generation.generate import Progress, generate, ignore
from vbaa_bench.generation.inventory import image_names
from vbaa_bench.scene.files import SceneFileError
from vbaa_bench.scene.frames import Frames
from vbaa_bench.scene.load import SceneFile
from vbaa_bench.scene.schema import Scene
from vbaa_bench.workers.cluster import ClusterAddress
from vbaa_bench.workers.jobs import Job, WorkerDiedError
from vbaa_bench.workers.machine import Machine


class RigResult(NamedTuple):
    """A rig's number, its row in rigs.csv, and why it could not be generated, empty if it could."""

    number: int
    row: dict[str, str | None]
    reason: str


def generate_collection(
    file: SceneFile,
    root: Path,
    variant: str,
    workers: int,
    progress: Progress,
    numbers: Sequence[int] | None = None,
    remark: Callable[[str], None] = ignore,
    *,
    cluster: ClusterAddress | None = None,
) -> list[RigResult]:
    """Generate the rigs of a collection at `root`, or finish them; return one result per rig.

    `numbers` are those of the rigs to make, by default all. A rig that is impossible, or has an
    image that cannot be rendered, is recorded with the reason. Workers of a `cluster` take the
    place of processes of this machine. The files that the scene names are copied into the folder,
    and rigs are made from the copies. Raises InputError for a folder that holds another collection
    or other files, or cannot be written, and for a file that the scene names and that cannot be
    used.
    """
    check_files(file)
    layout, files = CollectionLayout(root), file_digests(file)
    layout.check_scene(file.template, files)
    numbers = range(file.rigs or 1) if numbers is None else numbers
    with writing(root):
        root.mkdir(parents=True, exist_ok=True)
        with locked(root / ".lock"):
            # Check again: another process may have started here before we held the lock.
            if layout.check_scene(file.template, files) != "part":
                layout.write_scene(file.template, files)
            file = copy_files(file, files, layout.files.resolve())
            machine = Machine(variant, workers, cluster=cluster)
            results = _generate(layout, file, numbers, machine, progress, remark)
            _write_table(layout, results)
    return results


def _generate(
    layout: CollectionLayout,
    file: SceneFile,
    numbers: Sequence[int],
    machine: Machine,
    progress: Progress,
    remark: Callable[[str], None],
) -> list[RigResult]:
    # Rigs may differ in their numbers of frames, of which the first is an example.
    scene = accepted_rig(file).scene
    # One more than the images: the exposure is metered on an image that is not kept.
    per_rig = Frames(scene).count + len(image_names(scene)) + 1
    total = per_rig * len(numbers)
    results, deaths = list[RigResult](), dict[int, Deaths]()
    jobs = deque(Job("rig", (number, layout.rig(number).root.resolve(), {})) for number in numbers)
    arguments = file, machine.variant, machine.threads_each

    def again(job: Job, death: WorkerDiedError) -> Job | None:
        number, root, _ = job.arguments
        of_rig = deaths.setdefault(number, Deaths())
        try:
            of_rig.record(Layout(root), None, death)
        except ImageError as error:
            _remove_unfinished(Layout(root))
            row = rig_row(file, number, accepted_rig(file, number).scene, str(error), None)
            results.append(RigResult(number, row, str(error)))
            return None
        return Job("rig", (number, root, of_rig.given_up))

    with machine.pool(RigGenerator, arguments, remark) as pool:
        for ended in pool.survived(jobs, lambda done: progress(min(done, total), total), again):
            results.append(ended.result)
    progress(total, total)
    return sorted(results)


@dataclass
class RigGenerator:
    """One worker's generator of whole rigs of a scene."""

    file: SceneFile
    variant: str
    threads: int

    def rig(
        self,
        on_progress: Callable[[], None],
        number: int,
        root: Path,
        given_up: Mapping[str, str],
    ) -> RigResult:
        """Draw a rig and generate its dataset in this process; record why it is impossible.

        `given_up` has the reasons of frames that are not rendered.
        """
        finished = 0

        def progress(done: int, _total: int) -> None:
            nonlocal finished
            for _ in range(done - finished):
                on_progress()
            finished = done

        scene, reason, failed = None, "", None
        try:
            rig = accepted_rig(self.file, number)
            scene = rig.scene
            generate(rig, root, self.variant, 0, progress, threads=self.threads, given_up=given_up)
            failed = read_json(Layout(root).manifest)["failed_frames"]
        except (SceneFileError, FolderError, DamageError):  # not of the rig: of what is on the disk
            raise
        except ImageError as error:
            reason = str(error)
            _remove_unfinished(Layout(root))
        except InputError as error:
            reason = str(error).replace(f"{self.file.folder}/", "")
        finally:
            # A renderer refers to itself. Until it is freed, Dr.Jit compiles its materials into the
            # kernels of the next rig.
            gc.collect()
        return RigResult(number, rig_row(self.file, number, scene, reason, failed), reason)


def _remove_unfinished(layout: Layout) -> None:
    """Remove the folder of a rig that cannot be finished, unless it was complete before."""
    if not layout.hashes.is_file():
        shutil.rmtree(layout.root, ignore_errors=True)


def _write_table(layout: CollectionLayout, results: Sequence[RigResult]) -> None:
    """Write rigs.csv; rigs of earlier calls keep their rows."""
    rows = {result.number: result.row for result in results}
    try:
        old = layout.read_rows()
    except DamageError:  # rows of other rigs are written again when these are generated again
        old = {}
    layout.write_rows(old | rows)


def rig_row(
    file: SceneFile, number: int, rig: Scene | None, reason: str = "", failed: int | None = 0
) -> dict[str, str | None]:
    """Collect the row of a rig in rigs.csv: texts, None for an empty cell."""
    row: dict[str, Any] = {"rig": number, "reason": reason or None, "failed_frames": failed}
    if rig is not None:
        row |= {"seed": rig.seed, **file.rig_values(rig)}
    return {name: None if value is None else str(value) for name, value in row.items()}


def failed(results: Sequence[RigResult]) -> Iterator[str]:
    """Yield a sentence for each rig that could not be generated."""
    for result in results:
        if result.reason:
            yield f"rig {result.number} cannot be generated: {result.reason}"
