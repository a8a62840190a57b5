"""Fuzzed images, environment maps, textures and meshes, as the solver and scenes read them."""

import random
import re
from collections.abc import Callable
from pathlib import Path
from typing import Final

import trimesh

from solver.instrument.images import CHANNELS, eight_bit, image_head, read_grey
from tests.robustness.fuzz.damage import damaged
from tests.robustness.fuzz.pictures import picture
from vbaa_bench.assembly.mesh_file import KINDS, read_mesh
from vbaa_bench.dataset.exr import read_exr
from vbaa_bench.dataset.scene_files import read_file
from vbaa_bench.render.image_files import read_environment, read_surface_image
from vbaa_bench.scene.objects.mesh import touching

_NUMBERS: Final = (
    *("0", "-1", "nan", "inf", "1e308", "1e400", "99999999999", "1/2/3", "x", "", "1e-300"),
)


class Images:
    """Mutates image and mesh files, and reads each in one of the ways that the programs do."""

    def __init__(self, material: Path) -> None:
        """Read valid images of `material`/dataset."""
        observations = material / "dataset" / "observations"
        self._valid = [path.read_bytes() for path in sorted(observations.glob("*/*.png"))]
        box = trimesh.creation.box((0.01, 0.01, 0.01))
        self._meshes = {kind: _exported(box, kind) for kind in KINDS}
        self._readers: tuple[Callable[[random.Random, Path], None], ...] = (
            *(self._image, self._image, self._surface, self._environment, self._layers),
            *(self._mesh, self._mesh),
        )

    def attempt(self, chance: random.Random, folder: Path) -> None:
        """Write a file with mistakes, and read it."""
        chance.choice(self._readers)(chance, folder)

    def _image(self, chance: random.Random, folder: Path) -> None:
        path = self._written(chance, folder / chance.choice(("a.png", "a.png", "a.jpg", "a.tif")))
        if chance.random() < 0.3:
            image_head(path)
        eight_bit(read_grey(path, chance.choice(CHANNELS)))

    def _surface(self, chance: random.Random, folder: Path) -> None:
        path = self._written(chance, folder / chance.choice(("a.png", "a.jpg", "a.exr", "a.EXR")))
        read_surface_image(folder, path.name)

    def _environment(self, chance: random.Random, folder: Path) -> None:
        read_environment(folder, self._written(chance, folder / "a.exr").name)

    def _layers(self, chance: random.Random, folder: Path) -> None:
        read_exr(self._written(chance, folder / "a.exr"))

    def _written(self, chance: random.Random, path: Path) -> Path:
        path.write_bytes(picture(chance.choice(self._valid), chance))
        return path

    def _mesh(self, chance: random.Random, folder: Path) -> None:
        kind = chance.choice(KINDS)
        data = self._meshes[chance.choice((kind, kind, kind, chance.choice(KINDS)))]
        if kind in (".obj", ".ply") and chance.random() < 0.6:
            data = _renumbered(data, chance)
        else:
            data = damaged(data, chance)
        path = folder / f"a{kind}"
        path.write_bytes(data)
        mesh = read_mesh(
            read_file(folder, path.name, "mesh"), chance.choice((1.0, 1e-3, 1e-9, 1e9))
        )
        touching(mesh, 0.0004)


def _exported(mesh: trimesh.Trimesh, kind: str) -> bytes:
    encoding = {"encoding": "ascii"} if kind == ".ply" else {}
    data = mesh.export(file_type=kind[1:], **encoding)
    return data.encode() if isinstance(data, str) else bytes(data)


def _renumbered(data: bytes, chance: random.Random) -> bytes:
    """Replace some numbers or words of a text, such as counts, coordinates and indices."""
    words = list(re.finditer(rb"[\w.+-]+", data))
    for word in sorted(chance.sample(words, min(len(words), chance.choice((1, 1, 3)))), key=_end):
        new = chance.choice((chance.choice(_NUMBERS).encode(), chance.choice(words)[0]))
        data = data[: word.start()] + new + data[word.end() :]
    return data


def _end(word: re.Match[bytes]) -> int:
    return -word.end()
