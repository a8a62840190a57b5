"""Reading of one rig for an export: its table of readings and truth, and its files."""

import io
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Final

import polars as pl

from solver.instrument.camera import Camera
from solver.instrument.errors import DamageError, InputError, quoted
from solver.instrument.hashes import HASHES, MEND, listed, read_bytes, read_hashes
from solver.instrument.images import png_head
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.readers import Truth, open_manifest
from vbaa_bench.exports.columns import CENTRELINE, merged_schema

# Split of frames whose scene states no splits.
WHOLE: Final = "train"
# Columns of metadata.csv that are no numbers.
_TEXTS: Final = {"file_name", "frame_id", "push_id", "split"}
# First columns of every table.
_PLACE: Final = ("rig", "shard", "frame_id", "split", "push_id", "step")
# Tables of shards that are joined at once. Chosen: many small tables take more memory than one.
_BATCH: Final = 256


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

    @property
    def scene(self) -> Mapping[str, Any]:
        """The scene, as its manifest has it."""
        scene: Mapping[str, Any] = self.truth.manifest["scene"]
        return scene

    @cached_property
    def bits(self) -> int:
        """Bits per pixel of the image files: 8 or 16."""
        return png_head(next(path for name, path in self.files() if name.startswith("rest/"))).bits

    def table(self, progress: Callable[[int], None] = lambda _: None) -> pl.DataFrame:
        """Read readings and truth of all frames, without centrelines, in the order of the files.

        The columns `rig`, `shard` and `split` are always present. `progress` receives the number of
        shards that were read, now and then. Raises InputError.
        """
        batches, numbers = [], self.shards()
        for i in range(0, len(numbers), _BATCH):
            batches.append(_joined(map(self._shard_table, numbers[i : i + _BATCH])))
            if i:
                progress(i)
        table = _joined(batches)
        if not table.height:
            raise InputError(f"{self.layout.root}: holds no frames")
        return table

    def centrelines(self, shards: Iterable[int]) -> pl.DataFrame:
        """Read the centrelines of the frames of some shards, by `frame_id`. Raises InputError."""
        tables = [self._truth(number) for number in shards]
        wanted = pl.col("frame_id"), pl.col(f"^{CENTRELINE}.*$")
        return pl.concat([table.select(*wanted) for table in tables if table.height])

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
            if not name.startswith("shard_"):
                yield name, tree / name
        yield "truth_manifest.json", self.layout.manifest

    def _shard_table(self, number: int) -> pl.DataFrame:
        """Read the frames of one shard, of which there may be none."""
        folder = self.layout.shard(self.layout.observations, number)
        readings, truth = _readings(folder / "metadata.csv"), self._truth(number)
        if not (readings.height or truth.height):  # all its frames have failed
            return pl.DataFrame()
        names = ["frame_id", *(name for name in truth.columns if name not in readings.columns)]
        labels = truth.select(name for name in names if not name.startswith(CENTRELINE))
        table = readings.join(labels, on="frame_id", how="inner", maintain_order="left")
        if not table.height == readings.height == truth.height:
            raise InputError(
                f"{folder / 'metadata.csv'}: has {readings.height} frames and truth.parquet "
                f"{truth.height}, {table.height} of them the same; allowed are the same frames"
            )
        self._check_names(folder, table["frame_id"])
        split = pl.col("split") if "split" in table.columns else pl.lit(WHOLE).alias("split")
        place = [pl.lit(self.name).alias("rig"), pl.lit(number).alias("shard"), split]
        return table.with_columns(place).select(*_PLACE, pl.exclude(*_PLACE))

    def _truth(self, number: int) -> pl.DataFrame:
        path = self.layout.shard(self.layout.truth, number) / "truth.parquet"
        try:
            return pl.read_parquet(io.BytesIO(read_bytes(path)))
        except pl.exceptions.PolarsError as error:
            raise InputError(f"{path}: cannot be read ({error})") from error

    def _check_names(self, folder: Path, names: pl.Series) -> None:
        """Raise InputError unless hashes.json lists the image of every frame."""
        files = read_hashes(folder) or {}
        for name in names:
            if f"{name}.png" not in files or Path(name).name != name:
                raise InputError(
                    f"{folder / HASHES}: does not list the image of the frame {quoted(name)}"
                )

    def shards(self) -> list[int]:
        """List the numbers of the shards, of which both trees must have the same."""
        numbers = []
        for tree in (self.layout.observations, self.layout.truth):
            names = {name.partition("/")[0] for name in listed(tree) or []}
            shards = [name.removeprefix("shard_") for name in names if name.startswith("shard_")]
            numbers.append(sorted(int(text) for text in shards if text.isdigit()))
        if numbers[0] != numbers[1]:
            raise DamageError(f"{self.layout.root}: its trees have different shards; {MEND}")
        return numbers[0]


def _readings(path: Path) -> pl.DataFrame:
    """Read a metadata.csv, without `file_name`; an empty cell is null. Raises InputError."""
    try:
        table = pl.read_csv(io.BytesIO(read_bytes(path)), infer_schema=False)
        if not table.height:
            return table
        numbers = [name for name in table.columns if name not in {*_TEXTS, "step"}]
        return table.drop("file_name").with_columns(
            pl.col(numbers).cast(pl.Float64), pl.col("step").cast(pl.Int64)
        )
    except pl.exceptions.PolarsError as error:
        raise InputError(f"{path}: cannot be read ({error})") from error


def _joined(tables: Iterable[pl.DataFrame]) -> pl.DataFrame:
    """Concatenate tables, whose columns may differ; leave out those without rows."""
    filled = [table for table in tables if table.height]
    schema = merged_schema(table.schema for table in filled)
    return pl.concat(map(schema.applied, filled), rechunk=True) if filled else pl.DataFrame()
