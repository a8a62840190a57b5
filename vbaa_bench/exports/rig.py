"""Reading of one rig for an export: its table of readings and truth, and its files."""

import io
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Final

import polars as pl

from solver.instrument.camera import Camera
from solver.instrument.errors import DamageError, InputError, quoted, truncated
from solver.instrument.hashes import HASHES, MEND, read_bytes, read_hashes
from solver.instrument.images import image_head
from vbaa_bench.dataset.column import Kind
from vbaa_bench.dataset.dataset_columns import READINGS
from vbaa_bench.dataset.layout import METADATA, Layout, shard_numbers
from vbaa_bench.dataset.readers import Truth, open_manifest, read_shard
from vbaa_bench.dataset.splits import split_names

# Files of a rig outside shards; other names in a hashes.json, such as ../name, are left out.
_SINGLE: Final = re.compile(r"rig\.json|(calibration|rest)/\w[\w-]*\.png")
# First columns of every table, which make the index of the frames.
INDEX: Final = ("rig", "shard", "frame_id", "split", "push_id", "step")


@dataclass(frozen=True)
class Rig:
    """One dataset: `name` is that of its folder in a collection, or "rig" for a single dataset."""

    name: str
    layout: Layout

    @cached_property
    def truth(self) -> Truth:
        """The manifest, checked; without frames."""
        return open_manifest(self.layout.truth)

    @property
    def camera(self) -> Camera:
        """The true camera."""
        return self.truth.camera

    def stated(self, key: str) -> Any:
        """Return what the scene states for a key such as camera.mount. Raises InputError."""
        value: Any = self.truth.manifest["scene"]
        for name in key.split("."):
            if not isinstance(value, dict) or name not in value:
                raise InputError(f"{self.layout.manifest}: the key scene.{key} is missing")
            value = value[name]
        return value

    @cached_property
    def bits(self) -> int:
        """Bits per pixel of the image files, 8 or 16. Raises InputError without rest images."""
        images = [path for name, path in self.files() if name.startswith("rest/")]
        if not images:
            raise InputError(f"{self.layout.observations}: holds no rest/rest_*.png")
        return image_head(images[0]).bits

    def image_path(self, shard: int, frame_id: str) -> Path:
        """Return the path of a frame's image."""
        return self.layout.shard(self.layout.observations, shard) / f"{frame_id}.png"

    def image_digest(self, shard: int, frame_id: str) -> str:
        """Return the recorded sha256 of a frame's image."""
        folder = self.layout.shard(self.layout.observations, shard)
        return (read_hashes(folder) or {})[f"{frame_id}.png"]

    def files(self) -> Iterator[tuple[str, Path]]:
        """Yield names and paths of rig.json, the board views, the rest images and the manifest."""
        tree = self.layout.observations
        for name in sorted(read_hashes(tree) or {}):
            if _SINGLE.fullmatch(name):
                yield name, tree / name
        yield "truth_manifest.json", self.layout.manifest

    def frames(self, shard: int, *, centrelines: bool = False) -> pl.DataFrame:
        """Read readings and truth of the frames of one shard, of which there may be none.

        The columns `rig`, `shard` and `split` are always present. Raises InputError.
        """
        metadata = self.layout.shard(self.layout.observations, shard) / METADATA
        try:
            truth = read_shard(self.truth, shard, centrelines=centrelines)
            table = _joined(metadata, _readings(metadata), truth)
            if not table.height:  # all its frames have failed
                return table
            self._check_names(metadata.parent, table["frame_id"])
            place = table.with_columns(
                rig=pl.lit(self.name), shard=pl.lit(shard), split=split_names(table)
            )
            return place.select(*INDEX, pl.exclude(*INDEX))
        except pl.exceptions.PolarsError as error:
            raise InputError(f"{metadata}: cannot be read ({truncated(str(error))})") from error

    def _check_names(self, folder: Path, names: pl.Series) -> None:
        """Raise InputError unless hashes.json lists the image of every frame."""
        files = read_hashes(folder) or {}
        for name in names:
            if f"{name}.png" not in files or Path(name).name != name:
                raise InputError(
                    f"{folder / HASHES}: does not list the image of the frame {quoted(name)}"
                )

    def shards(self) -> list[int]:
        """List the numbers of the shards. Raises DamageError if the trees have different ones."""
        truth, observations = (shard_numbers(read_hashes(tree) or {}) for tree in self.layout.trees)
        if truth != observations:
            raise DamageError(f"{self.layout.root}: its trees have different shards; {MEND}")
        return truth


def _readings(path: Path) -> pl.DataFrame:
    """Read a metadata.csv, without `file_name`; an empty cell is null. Raises PolarsError."""
    table = pl.read_csv(io.BytesIO(read_bytes(path)), infer_schema=False)
    if not table.height:
        return table
    table = table.drop("file_name")
    kinds = {
        name: READINGS[name].kind if name in READINGS else Kind.NUMBER for name in table.columns
    }
    return table.cast({name: kind.dtype for name, kind in kinds.items()})


def _joined(metadata: Path, readings: pl.DataFrame, truth: pl.DataFrame) -> pl.DataFrame:
    """Join the tables of a shard. Raises InputError unless both have the same frames."""
    if not (readings.height or truth.height):
        return pl.DataFrame()
    names = ["frame_id", *(name for name in truth.columns if name not in readings.columns)]
    table = readings.join(truth.select(names), on="frame_id", how="inner", maintain_order="left")
    if not table.height == readings.height == truth.height:
        raise InputError(
            f"{metadata}: has {readings.height} frames and truth.parquet {truth.height}, "
            f"{table.height} of them the same; allowed are the same frames"
        )
    return table
