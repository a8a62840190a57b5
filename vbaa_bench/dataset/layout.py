"""Paths in a dataset folder.

DATASET/
  observations/   see solver/instrument/observation.py
  truth/
    identity.json                    scene, variant, target, versions, code, modules; written first
    files/                           copies of the files that the scene names; see scene_files.py
    metering.json                    exposure, sample table, and their frames; written once, second
    shard_00000/truth.parquet        one row per frame
    shard_00000/<frame_id>.exr       radiance and truth layers
    shard_00000/failures.json        why frames of the shard are missing; only if some are
    shard_00000/hashes.json          sha256 of each file of the shard
    manifest.json                    scene, seed, true rig, exposure, versions
    hashes.json                      sha256 of the files above, and of each shard's hashes.json
  derived/        tables computed from the truth, see derived.py
  .lock                              identifies the writing process

The shards of both trees are written first, then the manifest, truth/hashes.json and finally
observations/hashes.json. The dataset is complete if this last file exists.
"""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from solver.instrument.hashes import HASHES

# Folder of the files that a scene names, in the truth of a dataset and in a collection.
FILES: Final = "files"
# Table of a shard of the observations; table of one of the truth, and reasons of missing frames.
METADATA: Final = "metadata.csv"
TRUTH_TABLE: Final = "truth.parquet"
FAILURES: Final = "failures.json"
_SHARD: Final = re.compile(r"shard_(\d{5,})(?=/|\Z)")


def shard_name(number: int) -> str:
    """Name the folder of a shard."""
    return f"shard_{number:05d}"


def shard_hashes(number: int) -> str:
    """Name the hashes.json of a shard in the hashes.json of its tree."""
    return f"{shard_name(number)}/{HASHES}"


def shard_numbers(names: Iterable[str]) -> list[int]:
    """List the numbers of the shards among names of files and folders in a tree, sorted."""
    return sorted({int(match[1]) for name in names if (match := _SHARD.match(name))})


@dataclass(frozen=True)
class Layout:
    """The paths of the dataset at `root`."""

    root: Path

    @property
    def observations(self) -> Path:
        """The tree a solver may see."""
        return self.root / "observations"

    @property
    def truth(self) -> Path:
        """The tree a solver may not see."""
        return self.root / "truth"

    @property
    def derived(self) -> Path:
        """The folder of tables that are computed from the truth."""
        return self.root / "derived"

    @property
    def trees(self) -> tuple[Path, Path]:
        """Both trees, in the order in which they are completed."""
        return self.truth, self.observations

    @property
    def hashes(self) -> Path:
        """The observations' hashes.json, which is written last and completes the dataset."""
        return self.observations / HASHES

    @property
    def rig(self) -> Path:
        """The file with the nominal rig."""
        return self.observations / "rig.json"

    @property
    def identity(self) -> Path:
        """The file that identifies the dataset's scene and program."""
        return self.truth / "identity.json"

    @property
    def files(self) -> Path:
        """The folder of copies of the files that the scene names."""
        return self.truth / FILES

    @property
    def manifest(self) -> Path:
        """The file with the truth of the whole dataset."""
        return self.truth / "manifest.json"

    @property
    def metering(self) -> Path:
        """The file with what was measured before the first image."""
        return self.truth / "metering.json"

    @property
    def lock(self) -> Path:
        """The lock file, held by the process that writes the dataset."""
        return self.root / ".lock"

    def shard(self, tree: Path, number: int) -> Path:
        """Return the folder of one shard in one of the trees."""
        return tree / shard_name(number)

    def aside(self, job: str, process: str) -> Path:
        """Return the temporary folder of a process that does a job, such as shard_00000."""
        return self.root / f".{job}.{process}.part"

    def all_aside(self, job: str | None = None) -> list[Path]:
        """List the temporary folders of a job, or of all jobs."""
        return list(self.root.glob(f".{job or '*'}.*.part"))
