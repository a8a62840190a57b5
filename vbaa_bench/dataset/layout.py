"""Where things lie in a dataset folder.

DATASET/
  observations/   see solver/instrument/observation.py
  truth/
    identity.json                    scene, variant, versions; written first
    shard_00000/truth.parquet        one row a frame
    shard_00000/<frame_id>.exr       radiance and truth layers
    manifest.json                    scene, seed, true rig, versions, hashes; written last
"""

from dataclasses import dataclass
from pathlib import Path


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
    def hashes(self) -> Path:
        """Marks, with the manifest, a complete dataset."""
        return self.observations / "hashes.json"

    @property
    def manifest(self) -> Path:
        """Marks a complete truth."""
        return self.truth / "manifest.json"

    def shard(self, tree: Path, number: int) -> Path:
        """Folder of one shard in either tree."""
        return tree / f"shard_{number:05d}"

    def aside(self, number: int) -> Path:
        """Where a shard is made before it is moved into place."""
        return self.root / f".shard_{number:05d}.part"
