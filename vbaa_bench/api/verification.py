"""Verification of datasets and collections, with repair."""

from collections.abc import Callable, Collection
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from solver.instrument.errors import InputError
from solver.methods import METHODS
from vbaa_bench.api.data import AnyDataset, dataset_folder, usable_variant, worker_count
from vbaa_bench.api.scene import AnyScene
from vbaa_bench.dataset.faults import FOREIGN, Fault
from vbaa_bench.dataset.overall_digest import checked_digest, dataset_digest
from vbaa_bench.dataset.result_faults import remedy
from vbaa_bench.dataset.verify import Counts
from vbaa_bench.dataset.verify import faults as find_faults
from vbaa_bench.generation.generate import Progress, ignore
from vbaa_bench.generation.repair import repair as repair_faults
from vbaa_bench.scene.load import load_scene


@dataclass(frozen=True)
class Verification:
    """Result of a verification: what is wrong, what was repaired, and the commands to run.

    `faults` are those that remain after a repair.
    """

    root: Path
    faults: list[Fault]
    repaired: list[Fault]
    commands: list[str]
    counts: Counts
    # Digest of the whole dataset, None if it is incomplete.
    digest: str | None = None

    def record(self) -> dict[str, Any]:
        """Return the result as an object for JSON."""
        return {
            "dataset": str(self.root),
            "faults": [_record(fault) for fault in self.faults],
            "repaired": [_record(fault) for fault in self.repaired],
            "commands": self.commands,
            **asdict(self.counts),
            "digest": self.digest,
        }

    def __str__(self) -> str:
        counts = self.counts
        verdict = f"{len(self.faults)} faults" if self.faults else "nothing is wrong"
        lines = [
            f"{self.root}: {verdict}; checked were {counts.files} files of {counts.frames} frames "
            f"(datasets: {counts.datasets}, shards: {counts.shards})"
        ]
        if self.digest is not None:
            lines.append(f"digest {self.digest}")
        if self.repaired:
            lines.append(f"repaired: {len(self.repaired)} faults")
        return "\n".join([*lines, *(f"run: {command}" for command in self.commands)])


def verify(
    data: AnyDataset,
    methods: Collection[str] = tuple(METHODS),
    *,
    repair: bool = False,
    scene: AnyScene | None = None,
    against: str | None = None,
    workers: int | None = None,
    on_shard: Progress = ignore,
    on_fault: Callable[[str], None] = ignore,
    on_frame: Progress = ignore,
) -> Verification:
    """Find everything that is wrong in a dataset or collection; with `repair`, mend it.

    `scene` is that from which it is rendered again, by default the one that its records hold.
    `against` is the digest that the dataset must have; another one is a fault. `on_fault` is called
    with a sentence for each fault, `on_shard(done, total)` after each shard, and
    `on_frame(done, total)` as frames are rendered. Raises InputError if the folder is neither,
    cannot be repaired, or `against` is no digest.

    >>> result = vb.verify(data)
    >>> result.faults, result.counts.frames
    ([], 4)
    """
    file = load_scene(scene) if isinstance(scene, Path | str) else scene
    root = dataset_folder(data)
    expected = None if against is None else checked_digest(against)
    counts, first = Counts(), list[Fault]()
    for fault in find_faults(root, methods, counts, on_shard):
        first.append(fault)
        on_fault(str(fault))
    commands = [command for fault in first if (command := _command(root, fault.path))]
    repaired, remaining = list[Fault](), first
    if repair and first:
        count = worker_count(workers, usable_variant())
        repair_faults(root, first, file, count, on_frame, on_fault)
        counts = Counts()
        remaining = list(find_faults(root, methods, counts, on_shard))
        repaired = [fault for fault in first if fault not in remaining]
    digest = _digest(root)
    if expected is not None and digest != expected:
        other = Fault(root, FOREIGN, f"has {_named(digest)}, not {expected}")
        remaining = [*remaining, other]
        on_fault(str(other))
    commands = list(dict.fromkeys(commands))
    return Verification(root, remaining, repaired, commands, counts, digest)


def _named(digest: str | None) -> str:
    return "no digest, as it is incomplete" if digest is None else f"the digest {digest}"


def _digest(root: Path) -> str | None:
    """Compute the digest of a dataset; None if it is incomplete, which is reported as a fault."""
    try:
        return dataset_digest(root)
    except InputError:
        return None


def _command(root: Path, path: Path) -> str | None:
    """Name the command that computes a file again, of a dataset or of a rig of a collection."""
    rig = root / path.relative_to(root).parts[0] if path != root else root
    return remedy(root, path) or remedy(rig, path)


def _record(fault: Fault) -> dict[str, str]:
    return {"path": str(fault.path), "kind": fault.kind, "detail": fault.detail}
