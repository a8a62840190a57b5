"""A dataset, from scene to files: spec -> mechanics -> geometry -> render -> sensor -> dataset."""

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

from solver.instrument.errors import InputError
from solver.instrument.files import write_text
from solver.instrument.observation import INCOMPLETE
from solver.instrument.rig import rig_to_json
from vbaa_bench.bench import Bench
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.manifest import read_json, seal, versions
from vbaa_bench.plan import Plan, plan
from vbaa_bench.spec.load import SceneFile
from vbaa_bench.spec.rigs import nominal_rig
from vbaa_bench.spec.scene import Scene
from vbaa_bench.truth import dataset_facts
from vbaa_bench.workers import Pool

Progress = Callable[[int, int], None]


def generate(file: SceneFile, root: Path, variant: str, workers: int, progress: Progress) -> Layout:
    """Make the dataset of a scene at `root`, or finish one that was interrupted.

    `progress(done, total)` is called as images are made. A complete dataset of the same scene
    and seed is left as it is. Raises InputError where the scene is impossible or `root` is
    not writable or holds something else.
    """
    scene, layout = file.scene, Layout(root)
    work = plan(file)
    try:
        if _claim(layout, scene, variant):
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


def _claim(layout: Layout, scene: Scene, variant: str) -> bool:
    """Take `root` for this scene; True if its dataset is already complete. Raises InputError."""
    marker = layout.truth / "identity.json"
    identity = {
        "scene": scene.model_dump(mode="json"),
        "made_with": {"variant": variant, **versions()},
    }
    if not marker.is_file():
        if layout.root.exists() and any(layout.root.iterdir()):
            raise InputError(f"{layout.root}: holds something else; choose an empty folder")
        layout.truth.mkdir(parents=True)
        write_text(marker, json.dumps(identity) + "\n")
    found = read_json(marker)
    if found.get("scene") != identity["scene"]:
        raise InputError(
            f"{layout.root}: holds the dataset of another scene or seed; "
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
