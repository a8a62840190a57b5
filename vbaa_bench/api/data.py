"""Datasets: generate them, and open their contents."""

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import polars as pl

from solver.instrument.errors import InputError
from solver.instrument.hashes import read_bytes
from solver.instrument.observation import Observations, open_observations
from vbaa_bench.api.scene import AnyScene, scene_file
from vbaa_bench.dataset import exr
from vbaa_bench.dataset.collection import CollectionLayout, fork_of_collection
from vbaa_bench.dataset.identity import fork_of_dataset
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.readers import Truth, open_truth
from vbaa_bench.generation.generate import Part, ignore
from vbaa_bench.generation.generate import generate as generate_dataset
from vbaa_bench.generation.generate_collection import failed, generate_collection
from vbaa_bench.render.variant import ADVICE, PLAIN, choose
from vbaa_bench.report.console import print_line, progress_bar, progress_bars
from vbaa_bench.scene.load import SceneFile, load_scene
from vbaa_bench.workers.cluster import ClusterAddress
from vbaa_bench.workers.resources import cores


@dataclass(frozen=True)
class Dataset:
    """A dataset in the folder `root`, opened at first use, which may raise InputError."""

    root: Path | str

    @property
    def _layout(self) -> Layout:
        return Layout(Path(self.root))

    @cached_property
    def observations(self) -> Observations:
        """The input of a method: the nominal rig, and frames to iterate over."""
        return open_observations(self._layout.observations)

    @cached_property
    def truth(self) -> Truth:
        """The manifest, the true camera, and `frames`: a polars DataFrame, one row per frame."""
        return open_truth(self._layout.truth)


@dataclass(frozen=True)
class Collection:
    """Random rigs in the folder `root`: `rigs` are their datasets by number."""

    root: Path | str

    @cached_property
    def rigs(self) -> dict[int, Dataset]:
        """The complete datasets."""
        layouts = CollectionLayout(Path(self.root)).rigs()
        return {number: Dataset(layout.root) for number, layout in layouts.items()}

    @cached_property
    def table(self) -> pl.DataFrame:
        """The drawn values of every rig, one row per rig."""
        data = read_bytes(CollectionLayout(Path(self.root)).table)
        return pl.read_csv(data, infer_schema_length=None)


AnyDataset = Dataset | Collection | Path | str


def dataset_folder(data: AnyDataset) -> Path:
    """Return the folder of a dataset or a collection."""
    return Path(data.root if isinstance(data, Dataset | Collection) else data)


@functools.cache
def usable_variant(asked: str | None = None) -> str:
    """Choose Mitsuba's variant, once per process: probing in a child process takes seconds."""
    return choose(asked)


def worker_count(asked: int | None, variant: str) -> int:
    """Return the number of rendering processes, by default one per core."""
    # A scalar variant uses the machine better with Mitsuba's own threads than with processes.
    return asked or (1 if variant == PLAIN else cores())


def generate(
    scene: AnyScene,
    out: Path | str,
    *,
    workers: int | None = None,
    variant: str | None = None,
    part: tuple[int, int] | None = None,
    fork: bool = False,
    dask: str | None = None,
    progress: bool = False,
) -> Dataset:
    """Render the dataset of a scene into the folder `out`; finish an interrupted one.

    `workers` is the number of processes, by default one per core. `variant` is Mitsuba's, by
    default the fastest one that works. `progress` shows progress bars and messages on stderr. The
    files do not depend on the number of workers. Of random rigs, the first is rendered. With
    `part`, such as (2, 5), only the second of five parts is rendered. With `fork`, if `out` holds
    something else, the first of `out-2`, `out-3`, ... that is free or holds this very dataset is
    written instead. With `dask`, the address of a scheduler or a YAML file that describes a
    cluster, its workers render; they must see the same folders under the same paths.

    Raises InputError for an impossible scene, and for a folder that cannot be written or contains
    other files.
    """
    cluster = None if dask is None else ClusterAddress.checked(dask)
    file, chosen_variant = scene_file(scene), usable_variant(variant)
    root = fork_of_dataset(file, Path(out), chosen_variant) if fork else Path(out)
    remark = print_line if progress else ignore
    _announce(root, Path(out), remark)
    if chosen_variant == PLAIN and variant is None:
        remark(f"rendering with scalar_rgb, about ten times slower; {ADVICE}")
    with progress_bars(shown=progress) as bars:
        planning = progress_bar(bars, "mechanics")
        rendering = progress_bar(bars, "rendering", hidden=True)
        generate_dataset(
            file,
            root,
            chosen_variant,
            worker_count(workers, chosen_variant),
            rendering,
            planning,
            remark,
            part=None if part is None else Part(*part),
            cluster=cluster,
        )
    return Dataset(root)


def generate_rigs(
    scene: AnyScene,
    out: Path | str,
    *,
    rigs: Sequence[int] | None = None,
    workers: int | None = None,
    variant: str | None = None,
    fork: bool = False,
    dask: str | None = None,
    progress: bool = False,
) -> Collection:
    """Render the rigs of a scene, whose key `rigs` is their number, each as a dataset in `out`.

    `rigs` are the numbers of those to render, by default all. Further arguments are those of
    `generate`. A rig that is impossible is a row of `table` with the reason.

    Raises InputError for a folder that cannot be written or contains other files.
    """
    cluster = None if dask is None else ClusterAddress.checked(dask)
    file = scene if isinstance(scene, SceneFile) else load_scene(scene)
    if file.rigs is None:
        raise InputError(f"{file.path}: rigs is missing, so it describes one dataset only")
    chosen_variant = usable_variant(variant)
    root = fork_of_collection(file, Path(out)) if fork else Path(out)
    remark = print_line if progress else ignore
    _announce(root, Path(out), remark)
    with progress_bars(shown=progress) as bars:
        results = generate_collection(
            file,
            root,
            chosen_variant,
            worker_count(workers, chosen_variant),
            progress_bar(bars, "rendering"),
            rigs,
            remark,
            cluster=cluster,
        )
    for sentence in failed(results):
        remark(sentence)
    return Collection(root)


def _announce(root: Path, out: Path, remark: Callable[[str], None]) -> None:
    """Name the folder of a fork."""
    if root != out:
        remark(f"{out}: holds something else; writing to {root}")


def read_exr(path: Path | str) -> dict[str, np.ndarray]:
    """Read the truth layers of a frame: arrays (height, width), or (height, width, 3) of vectors.

    Raises InputError.
    """
    return exr.read_exr(Path(path))
