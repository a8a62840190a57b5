"""Paths of a collection: many random rigs of one scene, each a dataset in the same folder.

COLLECTION/
  collection.json   the scene with its distributions, and the sha256 of the files that it names
  files/            copies of these files
  rigs.csv          the truth of the rigs: their seeds and drawn values, or why one is impossible
  hashes.json       sha256 of these files
  rig_00000/        a dataset
"""

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Literal, NamedTuple

import polars as pl
from pydantic import Field

from solver.instrument.errors import DamageError, InputError, truncated
from solver.instrument.hashes import MEND, digest, read_bytes, read_hashes
from vbaa_bench.dataset.document import (
    Document,
    as_in_file,
    check_document,
    differences,
    listing,
    read_json,
)
from vbaa_bench.dataset.identity import OtherDatasetError, first_fork
from vbaa_bench.dataset.layout import FILES, Layout
from vbaa_bench.dataset.recorded import exists, write_recorded
from vbaa_bench.dataset.scene_files import file_digests
from vbaa_bench.scene.load import SceneFile

_RIG: Final = re.compile(r"rig_\d{5,}")


class _Scene(Document):
    """What is read of the scene, whose other values may be random."""

    title: str
    seed: int
    rigs: int | None = None
    files: dict[str, str] = Field(default_factory=dict)


@dataclass(frozen=True)
class CollectionLayout:
    """The paths of the collection at `root`."""

    root: Path

    @property
    def scene(self) -> Path:
        """The file that identifies the collection's scene."""
        return self.root / "collection.json"

    @property
    def files(self) -> Path:
        """The folder of copies of the files that the scene names."""
        return self.root / FILES

    @property
    def table(self) -> Path:
        """The table of the rigs and their drawn values."""
        return self.root / "rigs.csv"

    def read_scene(self) -> dict[str, Any]:
        """Read the collection's scene. Raises InputError if it cannot be one."""
        document = read_json(self.scene)
        check_document(self.scene, document, _Scene)
        return {key: value for key, value in document.items() if key != FILES}

    def read_files(self) -> dict[str, str]:
        """Read the sha256 of the files that the scene names, by name. Raises InputError."""
        document = read_json(self.scene)
        return dict(check_document(self.scene, document, _Scene).files)

    def rig(self, number: int) -> Layout:
        """Return the layout of one rig's dataset."""
        return Layout(self.root / f"rig_{number:05d}")

    def write_scene(self, scene: Mapping[str, Any], files: Mapping[str, str]) -> None:
        """Write the collection's scene, as keys and values with distributions. Raises OSError.

        `files` are the sha256 of the files that it names, of which there are copies.
        """
        write_recorded(
            self.root,
            {self.scene.name: _encoded(scene, files)},
            digests={f"{FILES}/{name}": value for name, value in files.items()},
        )

    def check_scene(
        self, scene: Mapping[str, Any], files: Mapping[str, str]
    ) -> Literal["empty", "same", "smaller", "part"]:
        """Check that the folder is empty or holds rigs of this scene, made with these files.

        A smaller collection, with fewer rigs, can grow; "part" is a smaller scene than that of the
        collection. A damaged collection.json is the same if its recorded hash is. Raises
        OtherDatasetError for other files, and for a collection of another scene; the message names
        the differences.
        """
        new, recorded = as_in_file(scene), (read_hashes(self.root) or {}).get(self.scene.name)
        if recorded == digest(_encoded(new, files)):
            return "same"
        if not self.scene.is_file():
            paths = self.root.iterdir() if self.root.exists() else iter(())
            names = [path.name for path in paths if not path.name.startswith(".lock")]
            if names:
                raise OtherDatasetError(
                    f"{self.root}: holds other files ({names[0]}); choose another folder"
                )
            return "empty"
        old = self.read_scene()
        changed = [one for one in differences(old, new) if one.key not in ("rigs", "title")]
        if changed:
            raise OtherDatasetError(
                f"{self.root}: holds the collection of another scene ({listing(changed)}); choose "
                "another folder with --out, start beside it with --fork, or delete this one"
            )
        if edited := [one.key for one in differences(self.read_files(), dict(files))]:
            raise OtherDatasetError(
                f"{self.root}: was made with other files than those beside the scene "
                f"({listing(edited)}); put back the files with which it was made, of which "
                f"{self.files} has copies, choose another folder with --out, start beside it with "
                "--fork, or delete this one"
            )
        return "part" if (old.get("rigs") or 0) > (new.get("rigs") or 0) else "smaller"

    def write_rows(self, rows: Mapping[int, Mapping[str, str | None]]) -> None:
        """Write the table of the rigs, by number. Raises OSError."""
        # Rigs whose sections differ have different columns; all are texts, as some have both.
        columns = dict.fromkeys(name for number in sorted(rows) for name in rows[number])
        table = pl.DataFrame(
            [rows[number] for number in sorted(rows)], schema=dict.fromkeys(columns, pl.String)
        )
        write_recorded(self.root, {self.table.name: table.write_csv().encode()})

    def read_rows(self) -> dict[int, dict[str, str | None]]:
        """Read the table of the rigs, by number; empty if there is none. Raises InputError."""
        if not exists(self.table):
            return {}
        try:
            rows = pl.read_csv(read_bytes(self.table), infer_schema=False).to_dicts()
            return {int(row["rig"]): row for row in rows}
        except (pl.exceptions.PolarsError, KeyError, TypeError, ValueError) as error:
            raise InputError(
                f"{self.table}: is not a table of rigs ({truncated(str(error))})"
            ) from error

    def folders(self) -> dict[int, Layout]:
        """Find the folders of rigs, complete or not, by number."""
        names = sorted(path.name for path in self.root.iterdir() if _RIG.fullmatch(path.name))
        return {int(name.removeprefix("rig_")): Layout(self.root / name) for name in names}

    def rigs(self) -> dict[int, Layout]:
        """Find the complete datasets of the collection, by number.

        Raises DamageError if rigs.csv lists a rig that is missing or incomplete.
        """
        layouts = {n: layout for n, layout in self.folders().items() if layout.hashes.is_file()}
        for number, row in self.read_rows().items():
            if not row.get("reason") and number not in layouts:
                raise DamageError(f"{self.rig(number).root}: is missing or incomplete; {MEND}")
        return layouts


def _encoded(scene: Mapping[str, Any], files: Mapping[str, str]) -> bytes:
    return (json.dumps({**scene, FILES: dict(files)}, indent=2) + "\n").encode()


class FrameCounts(NamedTuple):
    """Numbers of frames that were rendered, of those that failed, and of impossible rigs."""

    frames: int
    failed_frames: int
    failed_rigs: int = 0

    @property
    def complete(self) -> bool:
        """Whether nothing failed."""
        return not self.failed_frames and not self.failed_rigs


def count_frames(root: Path) -> FrameCounts:
    """Count the frames of a dataset or of a collection, from its manifests. Raises InputError."""
    if not is_collection(root):
        facts = read_json(Layout(root).manifest)
        return FrameCounts(facts["frames"], facts["failed_frames"])
    collection = CollectionLayout(root)
    rigs = [count_frames(layout.root) for layout in collection.rigs().values()]
    return FrameCounts(
        sum(rig.frames for rig in rigs),
        sum(rig.failed_frames for rig in rigs),
        sum(bool(row["reason"]) for row in collection.read_rows().values()),
    )


def fork_of_collection(file: SceneFile, root: Path) -> Path:
    """Return the first of DIR, DIR-2, DIR-3, ... that is free or holds this scene's collection.

    Raises InputError.
    """
    files = file_digests(file)
    return first_fork(
        root, lambda folder: CollectionLayout(folder).check_scene(file.template, files)
    )


def is_collection(root: Path) -> bool:
    """Test whether a folder holds a collection, perhaps a damaged one."""
    layout = CollectionLayout(root)
    return layout.scene.is_file() or layout.table.is_file()


def rigs_of(root: Path) -> list[Layout]:
    """List the datasets of a collection, or the one dataset that `root` is. Raises InputError."""
    if is_collection(root):
        return list(CollectionLayout(root).rigs().values())
    return [Layout(root)]
