"""Generation of a dataset: scene -> mechanics -> geometry -> render -> sensor -> dataset."""

import contextlib
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path, PurePath
from typing import NamedTuple

from solver.instrument.files import holds, write_bytes
from solver.instrument.hashes import digest
from solver.instrument.rig_json import rig_to_json
from vbaa_bench.assembly.plan import check_possible
from vbaa_bench.dataset.aside import clear_aside
from vbaa_bench.dataset.identity import check_identity, dataset_identity, write_identity
from vbaa_bench.dataset.layout import FILES, Layout
from vbaa_bench.dataset.lock import locked, writing
from vbaa_bench.dataset.manifest import dataset_facts, seal
from vbaa_bench.dataset.scene_files import check_copies, copy_files
from vbaa_bench.generation.dataset_worker import dataset_worker
from vbaa_bench.generation.deaths import Deaths
from vbaa_bench.generation.inventory import Contents, open_for_growth, surplus, take_inventory
from vbaa_bench.generation.metering_record import recorded_metering
from vbaa_bench.generation.missing_files import MissingFiles
from vbaa_bench.scene.frames import Frames
from vbaa_bench.scene.load import SceneFile
from vbaa_bench.scene.rigs import nominal_rig, true_rig
from vbaa_bench.workers.cluster import ClusterAddress
from vbaa_bench.workers.machine import Machine

Progress = Callable[[int, int], None]


class Part(NamedTuple):
    """One of several parts of a dataset: `number` from 1 to `total`; each has whole shards."""

    number: int
    total: int


def ignore(*_: object) -> None:
    """Accept progress and remarks, and do nothing."""


def generate(
    file: SceneFile,
    root: Path,
    variant: str,
    workers: int,
    progress: Progress,
    planning: Progress = ignore,
    remark: Callable[[str], None] = ignore,
    *,
    threads: int | None = None,
    part: Part | None = None,
    given_up: Mapping[str, str] | None = None,
    cluster: ClusterAddress | None = None,
) -> Layout:
    """Generate the dataset of a scene at `root`; finish an interrupted one, repair a damaged one.

    Every existing file is compared with its hash. Only missing or damaged files are generated, and
    files that do not belong to observations/ and truth/ are removed. Pushes are solved where they
    are rendered. A frame that fails, because its push is impossible or it cannot be rendered, is
    recorded with the reason and does not stop the others; the manifest counts them. The files that
    the scene names are copied to truth/files, from which everything is rendered. `given_up` has
    the reasons of frames that are not rendered because their processes died.

    `planning(done, total)` is called as pushes are checked, `progress(done, total)` as images are
    rendered, `remark(sentence)` for every damaged or removed file. With 0 workers, everything is
    rendered in this process. With a `part`, only its shards are generated: a dataset of its own
    that `merge` completes. `threads` is the number of threads of each process, by default all cores
    together. Workers of a `cluster` must see the same folders under the same paths.

    Raises InputError if the scene is impossible, and FolderError if `root` is not writable, is
    being written by another process, or holds something else, such as data of another scene or from
    another version of the code.
    """
    layout, machine = Layout(root), Machine(variant, workers, threads, cluster)
    with writing(layout.root):
        identity = dataset_identity(file, variant)
        check_identity(layout, identity)
        with _locked_folder(layout):
            # Check again: another process may have started here before we held the lock.
            state = check_identity(layout, identity)
            if state != "same":
                check_possible(file, planning, remark)
            shards = {
                number: shard
                for number, shard in enumerate(Frames(file.scene).in_shards())
                if part is None or number % part.total == part.number - 1
            }
            contents = Contents.of_scene(file.scene, shards, identity[FILES])
            if state == "smaller":
                open_for_growth(layout, contents)
            write_identity(layout, identity)
            deaths = Deaths(dict(given_up or {}))
            _complete(file, identity[FILES], contents, layout, machine, progress, remark, deaths)
    return layout


@contextlib.contextmanager
def _locked_folder(layout: Layout) -> Iterator[None]:
    """Hold the folder's lock. A folder created for it is removed if it stays empty."""
    new = not layout.root.exists()
    layout.root.mkdir(parents=True, exist_ok=True)
    try:
        with locked(layout.lock):
            yield
    finally:
        if new:
            with contextlib.suppress(OSError):
                layout.root.rmdir()


def _complete(
    file: SceneFile,
    digests: Mapping[str, str],
    contents: Contents,
    layout: Layout,
    machine: Machine,
    progress: Progress,
    remark: Callable[[str], None],
    deaths: Deaths,
) -> None:
    """Generate missing or damaged files in a locked folder, and seal the dataset.

    `digests` are the sha256 of the files that the scene names. Only copies of them are rendered.
    """
    scene, rig = file.scene, true_rig(file.scene)
    _remove_surplus(layout, contents, remark)
    inventory = take_inventory(layout, contents)
    for sentence in inventory.damage:
        remark(f"{sentence}; regenerating it")
    hashes = inventory.whole
    copy_files(file, digests, layout.files)
    hashes["truth"] |= {f"{FILES}/{name}": value for name, value in digests.items()}
    hashes["truth"][layout.identity.name] = digest(layout.identity.read_bytes())
    for folder in {path.parent for path in map(PurePath, contents.images)}:
        (layout.observations / folder).mkdir(parents=True, exist_ok=True)
    rig_json = rig_to_json(nominal_rig(scene)).encode()
    if not holds(layout.rig, rig_json):
        write_bytes(layout.rig, rig_json)
    hashes["observations"][layout.rig.name] = digest(rig_json)
    record = recorded_metering(layout, is_intact=layout.metering.name in hashes["truth"])
    missing = MissingFiles(layout, contents, inventory, deaths)
    if record is not None and not (missing.images or missing.shards):
        metering = record.metering
    else:
        identity = hashes["truth"][layout.identity.name]
        built = layout.root.resolve(), identity, machine.variant, machine.threads_each
        with machine.pool(dataset_worker, built, remark) as pool:
            metering = missing.generate(pool, progress, record)
    hashes["truth"][layout.metering.name] = digest(layout.metering.read_bytes())
    failed = sum(inventory.failed.values())
    factors = metering.table.factors
    facts = dataset_facts(scene, rig, machine.variant, metering.exposure, factors)
    facts |= {"frames": sum(map(len, contents.shards.values())) - failed, "failed_frames": failed}
    check_copies(digests, layout.files)
    seal(layout, facts, hashes)


def _remove_surplus(layout: Layout, contents: Contents, remark: Callable[[str], None]) -> None:
    clear_aside(layout)
    for path in list(surplus(layout, contents)):
        path.unlink()
        if not path.name.endswith(".part"):  # left by an interrupted write
            remark(f"{path}: was not generated; it is removed")
