"""A dataset, from scene to files: spec -> mechanics -> geometry -> render -> sensor -> dataset."""

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

from solver.instrument.errors import InputError
from solver.instrument.files import sha256, write_text
from solver.instrument.observation import INCOMPLETE
from solver.instrument.rig import rig_to_json
from vbaa_bench.bench import Bench
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.manifest import read_json, seal, versions
from vbaa_bench.plan import Plan, plan
from vbaa_bench.spec.load import SceneFile
from vbaa_bench.spec.objects import MeshSpec
from vbaa_bench.spec.rigs import nominal_rig
from vbaa_bench.truth import dataset_facts
from vbaa_bench.workers import Pool

Progress = Callable[[int, int], None]


def generate(
    file: SceneFile,
    root: Path,
    variant: str,
    workers: int,
    progress: Progress,
    planning: Progress = lambda _done, _total: None,
) -> Layout:
    """Make the dataset of a scene at `root`, or finish one that was interrupted.

    `planning(done, total)` is called as pushes are solved, `progress(done, total)` as images are
    made. A complete dataset of the same scene
    and seed is left as it is. Raises InputError where the scene is impossible or `root` is
    not writable or holds something else.
    """
    scene, layout = file.scene, Layout(root)
    if _claimed(layout, file):  # complete: what is there need not be solved again
        return layout
    work = plan(file, planning)
    try:
        if _claim(layout, file, variant):
            return layout
        write_text(layout.observations / "rig.json", rig_to_json(nominal_rig(scene)))
        exposure = _make(file, work, layout, (variant, workers), progress)
        seal(layout, dataset_facts(scene, work.rig, exposure, variant))
    except OSError as error:
        raise InputError(f"{layout.root}: cannot be written ({error.strerror})") from error
    return layout


def _make(
    file: SceneFile, work: Plan, layout: Layout, machine: tuple[str, int], progress: Progress
) -> float:
    """All images and shards that are not there yet; the exposure they were made with."""
    scene, folder = file.scene, file.path.parent.resolve()
    variant, workers = machine
    threads = max((os.cpu_count() or 1) // workers, 1)
    # One more than there are images: the exposure is measured from one that is not kept.
    total = work.frames + scene.calibration.views + scene.sensor.rest_images + 1
    with Pool(workers, Bench, (scene, work.rig, folder, layout, variant, threads)) as pool:
        exposure = float(pool.call("measure_exposure"))
        jobs: list[tuple[str, tuple[Any, ...]]] = [
            ("board_view", (view, exposure)) for view in range(scene.calibration.views)
        ]
        jobs += [("rest_image", (i, exposure)) for i in range(scene.sensor.rest_images)]
        finished = 0
        for number, shard in enumerate(work.shards):
            if layout.shard(layout.observations, number).is_dir():
                finished += len(shard)
            else:
                jobs.append(("shard", (number, shard, exposure)))
        pool.run(jobs, lambda done: progress(finished + done, total))
    return exposure


def _claimed(layout: Layout, file: SceneFile) -> bool:
    """Whether a complete dataset of this scene lies there."""
    complete = layout.hashes.is_file() and layout.manifest.is_file()
    marker = layout.truth / "identity.json"
    if not (complete and marker.is_file()):
        return False
    found = read_json(marker)
    return all(found.get(key) == value for key, value in _identity(file).items())


def _identity(file: SceneFile) -> dict[str, Any]:
    """What a dataset is of: the scene, and the files that it names."""
    scene = file.scene
    files: dict[str, str | None] = {}
    if isinstance(scene.object, MeshSpec):
        path = file.path.parent / scene.object.file
        files[scene.object.file] = sha256(path) if path.is_file() else None
    for light in scene.lights:
        if light.kind == "environment" and light.file is not None:
            path = file.path.parent / light.file
            files[light.file] = sha256(path) if path.is_file() else None
    return {"scene": scene.model_dump(mode="json"), "files": files}


def _claim(layout: Layout, file: SceneFile, variant: str) -> bool:
    """Take `root` for this scene; True if its dataset is already complete. Raises InputError."""
    marker = layout.truth / "identity.json"
    identity = {**_identity(file), "made_with": {"variant": variant, **versions()}}
    if not marker.is_file():
        if layout.root.exists() and any(layout.root.iterdir()):
            raise InputError(f"{layout.root}: holds something else; choose an empty folder")
        layout.truth.mkdir(parents=True)
        write_text(marker, json.dumps(identity) + "\n")
    found = read_json(marker)
    if any(found.get(key) != identity[key] for key in ("scene", "files")):
        raise InputError(
            f"{layout.root}: holds the dataset of another scene, seed or mesh; "
            "choose another folder, or remove it"
        )
    if layout.hashes.is_file() and layout.manifest.is_file():
        return True
    if found.get("made_with") != identity["made_with"]:
        raise InputError(
            f"{layout.root}: was begun with {found.get('made_with')}, here is "
            f"{identity['made_with']}; a dataset is of one kind, so remove the folder or finish "
            "it where it was begun"
        )
    for folder in ("calibration", "rest"):
        (layout.observations / folder).mkdir(parents=True, exist_ok=True)
    write_text(layout.observations / INCOMPLETE, "")
    return False
