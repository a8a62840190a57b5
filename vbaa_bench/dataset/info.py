"""Facts on a dataset or collection, complete or not, that need no image to be read."""

import os
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Final

from solver.instrument.errors import InputError
from solver.instrument.hashes import HASHES, read_bytes
from solver.instrument.images import image_head
from vbaa_bench.dataset.collection import CollectionLayout, is_collection
from vbaa_bench.dataset.document import read_json
from vbaa_bench.dataset.format_version import migrated_identity, migrated_manifest, version_of
from vbaa_bench.dataset.layout import FAILURES, METADATA, TRUTH_TABLE, Layout, shard_numbers
from vbaa_bench.dataset.result_faults import PREDICTIONS
from vbaa_bench.dataset.splits import read_splits
from vbaa_bench.dataset.tables import read_parquet

# Reasons of failed frames that are listed. Chosen: the rest is in the shards' failures.json.
_REASONS: Final = 5
# Where the dataset states none.
_UNKNOWN: Final = "unknown"


@dataclass
class DatasetInfo:
    """Facts on one dataset.

    `failures` are the first failed frames, as (frame id, reason); `derived`, `solved` and `scored`
    are names of tables and methods. Facts of the manifest and the identity are None or empty if
    these are not written yet.
    """

    dataset: str
    title: str | None = None
    complete: bool = False
    frames: int = 0
    failed_frames: int = 0
    failures: list[tuple[str, str]] = field(default_factory=list)
    shards: int = 0
    splits: dict[str, int] = field(default_factory=dict)
    processors: dict[str, int] = field(default_factory=dict)
    image: str | None = None
    seed: int | None = None
    variant: str | None = None
    schema: int | None = None
    versions: dict[str, str] = field(default_factory=dict)
    subset: dict[str, Any] | None = None
    bytes: int = 0
    derived: list[str] = field(default_factory=list)
    solved: list[str] = field(default_factory=list)
    scored: list[str] = field(default_factory=list)

    def record(self) -> dict[str, Any]:
        """Return the facts as an object for JSON."""
        return asdict(self)

    def lines(self) -> Iterator[tuple[str, str]]:
        """Yield the facts as names and texts."""
        yield "dataset", f"{self.dataset}" + ("" if self.complete else " (incomplete)")
        yield "title", self.title or _UNKNOWN
        yield "frames", f"{self.frames} in {self.shards} shards"
        if self.failed_frames:
            reasons = "; ".join(f"{name}: {reason}" for name, reason in self.failures)
            yield "failed frames", f"{self.failed_frames} ({reasons})"
        yield "splits", _counted(self.splits)
        yield "processors", _counted(self.processors)
        yield "images", self.image or _UNKNOWN
        yield "seed", str(self.seed)
        yield "variant", self.variant or _UNKNOWN
        yield "format", f"version {self.schema}"
        yield "versions", ", ".join(f"{name} {value}" for name, value in self.versions.items())
        if self.subset:
            yield "subset", ", ".join(f"{k} {v}" for k, v in self.subset.items() if v is not None)
        yield "size on disk", f"{self.bytes / 1e6:.1f} MB"
        yield "derived", ", ".join(self.derived) or "nothing"
        yield "solved", ", ".join(self.solved) or "nothing"
        yield "scored", ", ".join(self.scored) or "nothing"


def dataset_info(root: Path) -> DatasetInfo:
    """Collect the facts on a dataset. Raises InputError if there is none, or a file is damaged."""
    layout = Layout(root)
    if not layout.identity.is_file() and not layout.observations.is_dir():
        raise InputError(f"{root}: is not a dataset")
    info = DatasetInfo(str(root), complete=layout.hashes.is_file())
    if layout.identity.is_file():
        document = read_json(layout.identity)
        info.schema = version_of(layout.identity, document)
        identity = migrated_identity(layout.identity, document)
        info.versions = dict(identity.get("made_with") or {})
        info.variant = info.versions.pop("variant", None)
        info.seed = (identity.get("scene") or {}).get("seed")
        info.subset = identity.get("subset")
    if layout.manifest.is_file():
        manifest = migrated_manifest(layout.manifest, read_json(layout.manifest))
        info.title = (manifest.get("scene") or {}).get("title")
    _count_frames(layout, info)
    image = next(layout.observations.glob("shard_*/*.png"), None)
    if image is not None:
        head = image_head(image)
        info.image = f"{head.width} x {head.height} px, {head.bits} bits"
    info.bytes = sum(
        (Path(folder) / name).lstat().st_size
        for folder, _, names in os.walk(root)
        for name in names
    )
    info.derived = _stems(layout.derived)
    info.solved = _stems(root / PREDICTIONS)
    info.scored = _scored_methods(root)
    return info


def _count_frames(layout: Layout, info: DatasetInfo) -> None:
    """Count frames from the tables of each shard: failed ones, splits and processors."""
    splits, processors = Counter[str](), Counter[str]()
    for number in shard_numbers(path.name for path in layout.truth.glob("shard_*")):
        folder = layout.shard(layout.truth, number)
        table = folder / TRUTH_TABLE
        if not table.is_file():
            continue
        rows = read_parquet(table, read_bytes(table), {"frame_id", "processor"}.__contains__)
        info.shards += 1
        info.frames += rows.height
        values = rows["processor"] if "processor" in rows.columns else [None] * rows.height
        processors.update(value or _UNKNOWN for value in values)
        if (layout.shard(layout.observations, number) / METADATA).is_file():
            splits.update(read_splits(layout, number)["split"])
        failures = folder / FAILURES
        if failures.is_file():
            reasons = read_json(failures)
            info.failed_frames += len(reasons)
            info.failures += list(reasons.items())[: _REASONS - len(info.failures)]
    info.splits, info.processors = dict(splits), dict(processors)


def _counted(counts: Mapping[str, int]) -> str:
    return ", ".join(f"{name} {count}" for name, count in counts.items()) or "none"


def _stems(folder: Path) -> list[str]:
    paths = folder.iterdir() if folder.is_dir() else iter(())
    names = {path.stem for path in paths if path.name != HASHES and not path.name.startswith(".")}
    return sorted(names)


def _scored_methods(root: Path) -> list[str]:
    summary = root / "scores" / "summary.json"
    return sorted(read_json(summary).get("methods", {})) if summary.is_file() else []


@dataclass
class CollectionInfo:
    """Facts on a collection: of its rigs, and sums over them."""

    collection: str
    title: str | None
    rigs: int
    impossible_rigs: int
    frames: int
    failed_frames: int
    bytes: int
    complete: bool
    scored: list[str]
    datasets: list[DatasetInfo]

    def record(self) -> dict[str, Any]:
        """Return the facts as an object for JSON."""
        return asdict(self)

    def lines(self) -> Iterator[tuple[str, str]]:
        """Yield the facts as names and texts."""
        yield "collection", f"{self.collection}" + ("" if self.complete else " (incomplete)")
        yield "title", self.title or _UNKNOWN
        impossible = f", {self.impossible_rigs} impossible" if self.impossible_rigs else ""
        yield "rigs", f"{len(self.datasets)} of {self.rigs}{impossible}"
        yield "frames", f"{self.frames}, {self.failed_frames} failed"
        yield "size on disk", f"{self.bytes / 1e6:.1f} MB"
        yield "scored", ", ".join(self.scored) or "nothing"


def collection_info(root: Path) -> CollectionInfo:
    """Collect the facts on a collection. Raises InputError if a file is damaged."""
    layout = CollectionLayout(root)
    scene, rows = layout.read_scene(), layout.read_rows()
    datasets = [dataset_info(rig.root) for rig in layout.folders().values()]
    impossible = sum(bool(row.get("reason")) for row in rows.values())
    rigs = int(scene.get("rigs") or 1)
    return CollectionInfo(
        collection=str(root),
        title=scene.get("title"),
        rigs=rigs,
        impossible_rigs=impossible,
        frames=sum(one.frames for one in datasets),
        failed_frames=sum(one.failed_frames for one in datasets),
        bytes=sum(one.bytes for one in datasets),
        complete=len(datasets) + impossible >= rigs and all(one.complete for one in datasets),
        scored=_scored_methods(root),
        datasets=datasets,
    )


def info_of(root: Path) -> DatasetInfo | CollectionInfo:
    """Collect the facts on a dataset or collection. Raises InputError."""
    return collection_info(root) if is_collection(root) else dataset_info(root)
