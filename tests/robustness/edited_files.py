"""Edit files that a scene names while its dataset is generated, resumed, repaired or grown.

A dataset must then be, byte for byte, that of the unedited files; or the command refuses with one
sentence, and writes nothing. Whatever happened, the command completes the dataset once the files
are put back. Run 100 random edits:

  python -m tests.robustness.edited_files --trials 100 --seed 1
"""

import argparse
import hashlib
import os
import shutil
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, NamedTuple

import cv2
import numpy as np
import OpenEXR
import trimesh

from solver.instrument.errors import InputError
from tests.draws import generator
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.verify import Counts, faults
from vbaa_bench.generation.generate import generate
from vbaa_bench.generation.repair import repair
from vbaa_bench.render.variant import choose
from vbaa_bench.scene.load import SceneFile, load_scene

# Chosen: every kind of file, drawn at every level; images and noise targets that take 0.1 s.
_SCENE: Final = """\
title: Files that are edited
seed: 3
camera: {{width_px: 96, height_px: 32, focal_length_px: 130, position_mm: [120, 14, 360],
         look_at_mm: [120, 14, 0]}}
calibration: {{columns: 20, rows: 5, square_mm: 10, center_mm: [120, 20], views: 3}}
sensor: {{rest_images: 1}}
render: {{noise_near_beam: 5, noise_elsewhere: 5, noise_static_layer: 5, static_layer: false,
         sample_table: false}}
layers: []
background: {{pattern: image, image_file: {{choice: [c.png, b.png], per: frame}}}}
lights: [{{kind: environment, file: {{choice: [sky.exr, dusk.exr], per: frame}}}}]
object:
  choice:
    - {{kind: block, texture: {{kind: image, file: {{choice: [a.png, b.png], per: frame}}}}}}
    - {{kind: mesh, file: a.stl}}
    - {{kind: mesh, file: meshes/b.ply}}
  per: push
sampling: {{method: sobol, count: {count}, contact_distance_mm: [60, 200], deflection_pct: [3, 6]}}
frames_per_shard: 1
"""
_FILES: Final = ("a.png", "b.png", "c.png", "sky.exr", "dusk.exr", "a.stl", "meshes/b.ply")
_FRAMES: Final = 4
SITUATIONS: Final = ("generation", "resume", "repair", "growth")
EDITS: Final = ("other", "flip", "truncate", "delete", "pipe")
# Outcomes: the bytes of the unedited files; a refusal that writes nothing; other bytes without a
# message; a refusal that has changed the dataset; an error of another kind.
SAME, REFUSED, SILENT, WRITTEN, CRASHED = "same", "refused", "silent", "written", "crashed"
OUTCOMES: Final = (SAME, REFUSED, SILENT, WRITTEN, CRASHED)
Digests = dict[str, str]


class _InterruptError(Exception):
    """The command is interrupted."""


class Trial(NamedTuple):
    """An edit of a file, beside the scene or of the dataset's copies, and what came of it."""

    number: int
    situation: str
    name: str
    copy: bool
    edit: str
    outcome: str
    detail: str


def quiet(*_: object) -> None:
    """Report nothing."""


def write_files(folder: Path, scale: float) -> None:
    """Write all files; those of another scale are other, valid files."""
    (folder / "meshes").mkdir(parents=True, exist_ok=True)
    side = 12 * scale
    trimesh.creation.box(extents=(side, side, side)).export(folder / "a.stl")
    prism = trimesh.creation.cylinder(radius=side / 2, height=side, sections=8)
    prism.export(folder / "meshes" / "b.ply")
    for number, name in enumerate(("a.png", "b.png", "c.png")):
        image = np.full((4, 4), 60 + 50 * number, np.uint8)
        image[0] = 30 * scale
        cv2.imwrite(str(folder / name), image)
    for number, name in enumerate(("sky.exr", "dusk.exr")):
        radiance = np.ones((4, 8), np.float32)
        radiance[0] += scale * number + scale
        with OpenEXR.File({"type": OpenEXR.scanlineimage}, {"Y": radiance}) as file:
            file.write(str(folder / name))


def edit(path: Path, other: Path, how: str, random: np.random.Generator) -> None:
    """Edit a file; the time of its last change stays, where there is one."""
    stat, content = path.stat(), bytearray(path.read_bytes())
    match how:
        case "other":
            path.write_bytes(other.read_bytes())
        case "flip":
            content[int(random.integers(len(content)))] ^= 1 << int(random.integers(8))
            path.write_bytes(content)
        case "truncate":
            path.write_bytes(content[: int(random.integers(len(content)))])
        case "delete" | "pipe":
            path.unlink()
            if how == "pipe":
                os.mkfifo(path)
            return
    os.utime(path, ns=(stat.st_atime_ns, stat.st_mtime_ns))


def digests(root: Path) -> Digests:
    """Return the sha256 of all files; of what is no regular file, that."""
    return {
        path.relative_to(root).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        if path.is_file()
        else "not a regular file"
        for path in sorted(root.rglob("*"))
        if not path.is_dir()
    }


@dataclass
class Laboratory:
    """A folder with the files, other valid ones, and datasets of fewer and of all frames."""

    work: Path
    variant: str

    def __post_init__(self) -> None:
        self.files, self.other = self.work / "files", self.work / "other"
        write_files(self.files, 1.0)
        write_files(self.other, 1.1)
        self.whole, self.small = self.work / "whole", self.work / "small"
        for root, count in ((self.whole, _FRAMES), (self.small, _FRAMES - 1)):
            self._generate(self._scene(self.files, count), root)
        self.expected = digests(self.whole)

    def _scene(self, folder: Path, count: int = _FRAMES) -> SceneFile:
        path = folder / "scene.yaml"
        path.write_text(_SCENE.format(count=count), encoding="utf-8")
        return load_scene(path)

    def _generate(self, file: SceneFile, root: Path, step: Callable[..., None] = quiet) -> None:
        generate(file, root, self.variant, 0, step, step, threads=1)

    def trial(self, number: int, random: np.random.Generator) -> Trial:
        """Edit one file in one situation, and see what comes of it."""
        situation = SITUATIONS[number % len(SITUATIONS)]
        name, how = str(random.choice(_FILES)), str(random.choice(EDITS))
        of_copy = bool(random.random() < 0.4)
        folder = self.work / "trial"
        shutil.rmtree(folder, ignore_errors=True)
        scenes, root = folder / "scenes", folder / "set"
        shutil.copytree(self.files, scenes)
        path = (Layout(root).files if of_copy else scenes) / name

        def change() -> None:
            if path.is_file():
                edit(path, self.other / name, how, random)

        run = self._generation if situation == "generation" else self._on_a_dataset
        try:
            outcome, detail = run(situation, scenes, root, change, random)
        except Exception as error:  # noqa: BLE001  # any other error is a finding
            outcome, detail = CRASHED, f"{type(error).__name__}: {error}"
        return Trial(number, situation, name, of_copy, how, outcome, detail)

    def _generation(
        self,
        _situation: str,
        scenes: Path,
        root: Path,
        change: Callable[[], None],
        random: np.random.Generator,
    ) -> tuple[str, str]:
        """Edit at a random moment of a generation, which is interrupted now and then."""
        moment, calls = int(random.integers(14)), Counter[str]()
        end = moment + int(random.integers(4)) if random.random() < 0.5 else -1

        def step(_done: int, _total: int) -> None:
            if calls["all"] == moment:
                change()
            if calls["all"] == end:
                raise _InterruptError
            calls["all"] += 1

        details = []
        file = self._scene(scenes)
        for attempt in (step, quiet):  # once more with the edit in place
            try:
                self._generate(file, root, attempt)
                if digests(root) != self.expected:
                    return SILENT, "with the edit"
                details.append(SAME)
            except InputError as error:
                details.append(f"{REFUSED}: {error}")
            except _InterruptError:
                details.append("interrupted")
                if not Layout(root).identity.is_file():
                    break  # nothing was written: a dataset of the edited file would be right
        for path in scenes.rglob("*.*"):
            path.unlink()
        shutil.copytree(self.files, scenes, dirs_exist_ok=True)
        self._generate(self._scene(scenes), root)
        same = digests(root) == self.expected
        refused = any(detail.startswith(REFUSED) for detail in details)
        return (REFUSED if refused else SAME) if same else SILENT, "; then ".join(details)

    def _on_a_dataset(
        self,
        situation: str,
        scenes: Path,
        root: Path,
        change: Callable[[], None],
        random: np.random.Generator,
    ) -> tuple[str, str]:
        """Edit a file, and then resume, repair or grow a dataset."""
        shutil.copytree(self.small if situation == "growth" else self.whole, root)
        layout, file = Layout(root), self._scene(scenes)
        shard = layout.shard(layout.truth, int(random.integers(_FRAMES - 1)))
        if situation == "resume":
            for path in (layout.hashes, layout.truth / "hashes.json", layout.manifest):
                path.unlink()
            shutil.rmtree(shard)
        elif situation == "repair":
            (shard / "truth.parquet").write_bytes(b"damaged")
        change()
        before = digests(root)
        try:
            if situation == "repair":
                found = list(faults(root, (), Counts(), quiet))
                own = random.random() < 0.5  # by the dataset's own records
                repair(root, found, None if own else file, 0, quiet, quiet)
            else:
                self._generate(file, root)
        except InputError as error:
            return REFUSED if digests(root) == before else WRITTEN, str(error)
        return SAME if digests(root) == self.expected else SILENT, ""


def run_trials(
    count: int, seed: int, variant: str, work: Path, minutes: float = np.inf
) -> Iterator[Trial]:
    """Run random trials, each of which depends on the seed and its number, until time is up."""
    start, laboratory = time.monotonic(), Laboratory(work, variant)
    for number in range(count):
        if time.monotonic() - start > 60 * minutes:
            return
        yield laboratory.trial(number, generator("edited files", seed, number))


def main() -> None:
    """Run the trials, and print a table of situations and outcomes."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--trials", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--minutes", type=float, default=60.0, help="no trial begins after this")
    options = parser.parse_args()
    counts, bad = Counter[Any](), 0
    with tempfile.TemporaryDirectory(prefix="edited_files_") as work:
        variant = choose()
        for trial in run_trials(options.trials, options.seed, variant, Path(work), options.minutes):
            counts[trial.situation, trial.outcome] += 1
            bad += trial.outcome not in (SAME, REFUSED)
            print(*trial, sep=" | ", flush=True)
    for situation in SITUATIONS:
        texts = (f"{counts[situation, one]} {one}" for one in OUTCOMES)
        print(f"{situation}: {', '.join(texts)}")
    print(f"{sum(counts.values())} trials, {bad} of them wrong")
    raise SystemExit(bool(bad))


if __name__ == "__main__":
    main()
