"""The interface of a format: how a part of an export is written, completed and read back."""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

from vbaa_bench.exports.output import Record
from vbaa_bench.exports.parts import Cut, Part
from vbaa_bench.exports.source import Source


class Exported(NamedTuple):
    """One frame as it is in an export: name, split, bytes of its image, and values by column."""

    key: str
    split: str
    image: bytes
    values: Mapping[str, Any]


class Format(ABC):
    """An export format: `cut` divides the frames into parts, by default by `usual_cut`."""

    usual_cut: ClassVar[Cut]
    # Shown in the card: the files with the frames, and how they are loaded.
    layout: ClassVar[str]
    loading: ClassVar[str]

    def __init__(self, most_bytes: int | None = None) -> None:
        usual = self.usual_cut
        self.cut = usual if most_bytes is None else replace(usual, most_bytes=most_bytes)

    def refusal(self, _source: Source) -> str:
        """Say why the format cannot hold this source; empty if it can."""
        return ""

    @abstractmethod
    def write_part(self, folder: Path, part: Part) -> Record:
        """Write the files of a part, and return what `finish` needs of it. Raises OSError."""

    @abstractmethod
    def finish(self, folder: Path, source: Source, records: Sequence[Record]) -> None:
        """Write the files that describe all parts; may be called again. Raises OSError."""

    @abstractmethod
    def read_back(self, folder: Path, source: Source) -> Iterator[Exported]:
        """Read all frames of a finished export, in the order of its parts."""

    def structure_errors(self, _folder: Path, _source: Source) -> Iterator[str]:
        """Check what the format states besides its frames, and describe each error."""
        yield from ()

    def front_matter(self, _source: Source) -> str:
        """Return the first lines of the card, for catalogues."""
        return ""
