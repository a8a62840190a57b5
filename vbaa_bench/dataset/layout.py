"""Where things lie in a dataset folder.

DATASET/
  observations/   see solver/instrument/observation.py
  truth/
    identity.json                    scene, variant, versions, code; written first
    shard_00000/truth.parquet        one row a frame
    shard_00000/<frame_id>.exr       radiance and truth layers
    shard_00000/hashes.json          sha256 of each file of the shard
    manifest.json                    scene, seed, true rig, exposure, versions
    hashes.json                      sha256 of the files above, and of each shard's hashes.json
  .lock                              names the process that is writing

The shards of both trees are written first, then the manifest, truth/hashes.json and at last
observations/hashes.json: the dataset is complete with this one file.
"""

from dataclasses import dataclass
from pathlib import Path

from solver.instrument.hashes import HASHES


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
        """The tree it may not."""
        return self.root / "truth"

    @property
    def trees(self) -> tuple[Path, Path]:
        """Both trees, in the order in which they are completed."""
        return self.truth, self.observations

    @property
    def hashes(self) -> Path:
        """Completes the dataset, and is written last."""
        return self.observations / HASHES

    @property
    def identity(self) -> Path:
        """What the dataset is of, and what it is made with."""
        return self.truth / "identity.json"

    @property
    def manifest(self) -> Path:
        """What is true of the whole dataset."""
        return self.truth / "manifest.json"

    @property
    def lock(self) -> Path:
        """Held by the process that writes the dataset."""
        return self.root / ".lock"

    def shard(self, tree: Path, number: int) -> Path:
        """Folder of one shard in one of the trees."""
        return tree / f"shard_{number:05d}"

    def aside(self, number: int) -> Path:
        """Where a shard is made before it is moved into place."""
        return self.root / f".shard_{number:05d}.part"
