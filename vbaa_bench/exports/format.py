"""The interface of a format: how a part of an export is written, completed and read back.

A format is one module with one subclass of Format. It is chosen by its name in FORMATS, or, in a
module of the user's own, as package.module:Class: see docs/export_formats.md.
"""

import importlib
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Final, NamedTuple

from solver.instrument.errors import InputError, described, quoted

if TYPE_CHECKING:
    # The help of the command needs the names only, and polars takes a while to import.
    from vbaa_bench.exports.output import Record
    from vbaa_bench.exports.parts import Cut, Part
    from vbaa_bench.exports.source import Source

FORMATS: Final = {
    "hf": "vbaa_bench.exports.hugging_face:HuggingFace",
    "webdataset": "vbaa_bench.exports.web_dataset:WebDataset",
    "lerobot": "vbaa_bench.exports.lerobot:LeRobot",
    "csv": "vbaa_bench.exports.flat_csv:FlatCsv",
}


class Exported(NamedTuple):
    """One frame as it is in an export: name, split, bytes of its image, and values by column.

    `image` is None in a format without images. `values` may lack columns that it does not have.
    """

    key: str
    split: str
    image: bytes | None
    values: Mapping[str, Any]


class Format(ABC):
    """An export format: `cut` divides the frames into parts, by default by `usual_cut`."""

    usual_cut: ClassVar["Cut"]
    # Raise it when the files change, so that an interrupted export begins again.
    version: ClassVar[int] = 1
    # Shown in the card: the files with the frames, and how they are loaded.
    layout: ClassVar[str]
    loading: ClassVar[str]

    def __init__(self, most_bytes: int | None = None) -> None:
        usual = self.usual_cut
        self.cut = usual if most_bytes is None else replace(usual, most_bytes=most_bytes)

    def refusal(self, _source: "Source") -> str:
        """Say why the format cannot hold this source; empty if it can."""
        return ""

    @abstractmethod
    def write_part(self, folder: Path, part: "Part") -> "Record":
        """Write the files of a part, and return what `finish` needs of it. Raises OSError."""

    @abstractmethod
    def finish(self, folder: Path, source: "Source", records: Sequence["Record"]) -> None:
        """Write the files that describe all parts; may be called again. Raises OSError."""

    @abstractmethod
    def read_back(self, folder: Path, source: "Source") -> Iterator[Exported]:
        """Read all frames of a finished export, in the order of its parts."""

    def structure_errors(self, _folder: Path, _source: "Source") -> Iterator[str]:
        """Check what the format states besides its frames, and describe each error."""
        yield from ()

    def front_matter(self, _source: "Source") -> str:
        """Return the first lines of the card, for catalogues."""
        return ""


def find_format(name: str) -> type[Format]:
    """Return a format by its name in FORMATS or as package.module:Class. Raises InputError."""
    module, colon, attribute = FORMATS.get(name, name).partition(":")
    if not (module and colon and attribute):
        raise InputError(
            f"the format {quoted(name)} is unknown, allowed is one of {', '.join(FORMATS)}, or "
            "package.module:Class"
        )
    try:
        found = getattr(importlib.import_module(module), attribute)
    except Exception as error:
        raise InputError(
            f"the format {quoted(name)} cannot be imported: {described(error)}"
        ) from error
    if not (isinstance(found, type) and issubclass(found, Format)):
        raise InputError(f"the format {quoted(name)} is no subclass of {__name__}.Format")
    return found
