"""Export of a dataset or a collection to another format, with a check of what was written."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from solver.instrument.errors import DamageError, InputError
from solver.instrument.files import write_bytes, write_text
from solver.instrument.hashes import read_bytes
from vbaa_bench.dataset.lock import writing
from vbaa_bench.exports.card import card
from vbaa_bench.exports.check import differences
from vbaa_bench.exports.format import find_format
from vbaa_bench.exports.output import check_absent, export_folder
from vbaa_bench.exports.parts import parts
from vbaa_bench.exports.source import Source, open_source


@dataclass(frozen=True)
class Export:
    """A finished export: its folder, and the number of frames by split."""

    folder: Path
    splits: dict[str, int]

    @property
    def frames(self) -> int:
        """Number of all frames."""
        return sum(self.splits.values())


def export(
    root: Path,
    name: str,
    out: Path,
    progress: Callable[[str, int, int], None],
    *,
    centrelines: bool = False,
    most_bytes: int | None = None,
) -> Export:
    """Write a dataset or collection in a format to the new folder `out`.

    `name` is one of FORMATS or package.module:Class, a subclass of Format.
    Every frame is read back and compared. `progress` receives the step, what is done of it, and
    all of it: shards that are read, then frames. `most_bytes` is the size of the images in one
    file, by default that of the format. An interrupted export continues at the next call. Raises
    InputError if the format is unknown, if the dataset is incomplete or damaged, if the format
    cannot hold it, or if `out` exists or cannot be written.
    """
    check_absent(out)
    chosen = find_format(name)(most_bytes)
    source = open_source(
        root, centrelines=centrelines, progress=lambda n, of: progress("reading", n, of)
    )
    if reason := chosen.refusal(source):
        raise InputError(f"{root}: {reason}")
    identity = {
        "format": name,
        "version": chosen.version,
        "centrelines": centrelines,
        "most_bytes": most_bytes,
        "source": source.identity(),
    }
    with writing(out), export_folder(out, identity) as output:
        done = 0
        for part in parts(source, chosen.cut):
            if part.index >= len(output.records):
                output.finish_part(chosen.write_part(output.folder, part))
            done += part.table.height
            progress("writing", done, source.frames)
        _write_rigs(output.folder, source)
        chosen.finish(output.folder, source, output.records)
        write_text(output.folder / "README.md", card(source, chosen))
        errors = differences(
            chosen, output.folder, source, lambda n: progress("checking", n, source.frames)
        )
        if errors:
            output.forget()
            raise DamageError(f"{out}: is not what was exported: {'; '.join(errors)}")
    return Export(out, source.splits)


def _write_rigs(folder: Path, source: Source) -> None:
    """Write rig.json, the manifest, the board views and the rest images of every rig."""
    for name, rig in source.rigs.items():
        for file_name, path in rig.files():
            target = folder / "rigs" / name / file_name
            target.parent.mkdir(parents=True, exist_ok=True)
            write_bytes(target, read_bytes(path))
