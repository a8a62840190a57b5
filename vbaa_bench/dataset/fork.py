"""Choice of a folder beside one that holds something else."""

import contextlib
from collections.abc import Callable
from pathlib import Path
from typing import Final

from solver.instrument.errors import InputError
from vbaa_bench.dataset.collection import CollectionLayout
from vbaa_bench.dataset.identity import OtherDatasetError, check_identity, dataset_identity
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.scene_files import file_digests
from vbaa_bench.scene.load import SceneFile

# Chosen: more datasets of one scene than anyone keeps in one folder.
_LARGEST: Final = 1000


def fork_of_dataset(file: SceneFile, root: Path, variant: str) -> Path:
    """Return the first of DIR, DIR-2, DIR-3, ... that is free or holds the dataset of this scene.

    Raises InputError.
    """
    identity = dataset_identity(file, variant)
    return _first(root, lambda folder: check_identity(Layout(folder), identity))


def fork_of_collection(file: SceneFile, root: Path) -> Path:
    """Return the first of DIR, DIR-2, DIR-3, ... that is free or holds this scene's collection.

    Raises InputError.
    """
    files = file_digests(file)
    return _first(root, lambda folder: CollectionLayout(folder).check_scene(file.template, files))


def _first(root: Path, check: Callable[[Path], object]) -> Path:
    try:
        for number in range(1, _LARGEST + 1):
            folder = root if number == 1 else root.with_name(f"{root.name}-{number}")
            with contextlib.suppress(OtherDatasetError):
                check(folder)
                return folder
    except OSError as error:
        raise InputError(f"{root}: cannot be read ({error.strerror})") from error
    raise InputError(f"{root}-{_LARGEST}: holds another dataset; choose another folder with --out")
