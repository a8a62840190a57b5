"""WebDataset: tar files with one image and one JSON object per frame.

OUT/
  <split>-000000.tar    <frame>.png, <frame>.json, <frame>.png, ...
  index.json            the tar files and their numbers of frames, as the library's wids reads it
"""

import io
import json
import os
import tarfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import ClassVar, Final

from solver.instrument.files import write_text
from vbaa_bench.exports.columns import SHARD
from vbaa_bench.exports.format import Exported, Format
from vbaa_bench.exports.output import Record
from vbaa_bench.exports.parts import Cut, Part
from vbaa_bench.exports.source import Source

# Chosen: the library advises 0.1 to 1 GB; a shuffling reader keeps several open.
_TAR_BYTES: Final = 256_000_000
# Chosen: the list of a tar file's members is kept in memory, 2 kB per frame.
_TAR_FRAMES: Final = 10_000


class WebDataset(Format):
    """Tar files of bounded size."""

    usual_cut: ClassVar = Cut(_TAR_BYTES, _TAR_FRAMES)
    layout: ClassVar = """\
- `<split>-000000.tar`: `<frame>.png` and `<frame>.json`, one after the other.
- `index.json`: the tar files and their numbers of frames.
- The library's own decoders of images (`decode("pil")`) convert to 8 bits; open images as below."""
    loading: ClassVar = """\
import io

import webdataset as wds
from PIL import Image

frames = wds.WebDataset("{split}-000000.tar", shardshuffle=False).decode()
frame = next(iter(frames))
image, label = Image.open(io.BytesIO(frame["png"])), frame["json"]
"""

    def write_part(self, folder: Path, part: Part) -> Record:
        """Write one tar file. The same frames give the same bytes."""
        path = folder / f"{part.split}-{part.number:06d}.tar"
        with path.open("wb") as stream:
            with tarfile.open(fileobj=stream, mode="w", format=tarfile.USTAR_FORMAT) as tar:
                for frame in part.frames():
                    values = {name: value for name, value in frame.row.items() if name != SHARD}
                    _add(tar, f"{frame.key}.png", frame.png)
                    _add(tar, f"{frame.key}.json", json.dumps(values).encode())
            stream.flush()
            os.fsync(stream.fileno())
        return {"file": path.name, "split": part.split, "frames": part.table.height}

    def finish(self, folder: Path, source: Source, records: Sequence[Record]) -> None:
        """Write the index of the tar files."""
        shards = [{"url": record["file"], "nsamples": record["frames"]} for record in records]
        index = {"wids_version": 1, "name": source.title, "shardlist": shards}
        write_text(folder / "index.json", json.dumps(index, indent=2) + "\n")

    def read_back(self, folder: Path, _source: Source) -> Iterator[Exported]:
        """Read the members of all tar files; the index must list each file and its frames."""
        for shard in json.loads((folder / "index.json").read_bytes())["shardlist"]:
            split = shard["url"].rpartition("-")[0]
            image = "", b""
            with tarfile.open(folder / shard["url"]) as tar:
                for member in tar:
                    stream = tar.extractfile(member)
                    key, _, kind = member.name.partition(".")
                    data = stream.read() if stream else b""
                    if kind == "png":
                        image = key, data
                    else:  # without its own image a frame has none
                        png = image[1] if image[0] == key else b""
                        yield Exported(key, split, png, json.loads(data))


def _add(tar: tarfile.TarFile, name: str, data: bytes) -> None:
    member = tarfile.TarInfo(name)
    member.size, member.mode = len(data), 0o644
    tar.addfile(member, io.BytesIO(data))
