"""Names in a dataset or scene never lead out of their folder; sizes are bounded before memory."""

import ast
import io
import json
import os
import shutil
import struct
import subprocess
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from solver.instrument.errors import DamageError, InputError
from solver.instrument.hashes import HASHES, digest, parse_hashes, read_bytes
from solver.instrument.images import png_bytes
from solver.instrument.metadata import read_frames
from tests.test_floor_plan import ROOT, modules
from vbaa_bench.dataset.document import read_json
from vbaa_bench.dataset.exr import exr_bytes, read_exr
from vbaa_bench.dataset.tables import read_parquet
from vbaa_bench.scene.files import file_of_scene


@pytest.mark.parametrize(
    "name",
    ["/etc/passwd", "../a", "a/../../b", "a/..", "..", ".", "a//b", "a/", "", "a\0b", "./a"],
)
def test_a_table_of_hashes_names_only_files_below_it(tmp_path: Path, name: str) -> None:
    data = json.dumps({"fine.csv": "1", name: "0"}).encode()
    assert parse_hashes(data) is None
    (tmp_path / HASHES).write_bytes(data)
    (tmp_path / "fine.csv").touch()
    with pytest.raises(DamageError, match="names of files in this folder"):
        read_bytes(tmp_path / "fine.csv")
    assert parse_hashes(b'{"shard_00000/a..png": "0", ".b": "1", "..c": "2"}')


def test_a_listed_file_is_no_link(tmp_path: Path) -> None:
    folder = tmp_path / "tree" / "shard_00000"
    folder.mkdir(parents=True)
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "a.png").write_bytes(b"1")
    table = {"shard_00000/a.png": digest(b"1")}
    (folder.parent / HASHES).write_text(json.dumps(table))
    (folder / "a.png").symlink_to(tmp_path / "other" / "a.png")
    with pytest.raises(DamageError, match=r"a\.png: is a link"):
        read_bytes(folder / "a.png")
    shutil.rmtree(folder)
    folder.symlink_to(tmp_path / "other")
    with pytest.raises(DamageError, match="shard_00000: is a link"):
        read_bytes(folder / "a.png")


def test_a_table_of_frames_names_only_files_below_it(tmp_path: Path) -> None:
    folder = tmp_path / "shard_00000"
    (folder / "sub").mkdir(parents=True)
    image = png_bytes(np.zeros((2, 2), np.uint8))
    for path in (folder / "sub" / "a.png", tmp_path / "secret.png"):
        path.write_bytes(image)
    (folder / "inside.png").symlink_to(folder / "sub" / "a.png")
    (folder / "outside.png").symlink_to(tmp_path / "secret.png")
    table = folder / "metadata.csv"

    def names(name: str) -> list[str]:
        table.write_text(f"file_name,motor_angle_deg\n{name},0\n")
        return [frame.path.name for frame in read_frames(table)]

    assert names("sub/a.png") + names("inside.png") == ["a.png", "inside.png"]
    for name in ("../secret.png", str(tmp_path / "secret.png"), "outside.png"):
        with pytest.raises(InputError, match="allowed is a file beside the table"):
            names(name)


def test_files_of_a_scene_are_in_its_folder(tmp_path: Path) -> None:
    folder = tmp_path / "scenes"
    (folder / "meshes").mkdir(parents=True)
    (folder / "link.stl").symlink_to(tmp_path / "secret.stl")
    (folder / "loop").symlink_to(folder / "loop")
    assert file_of_scene(folder, "meshes/a.stl") == folder / "meshes" / "a.stl"
    for name in ("../secret.stl", str(tmp_path / "secret.stl"), "link.stl", "meshes/../../secret"):
        with pytest.raises(InputError, match="is outside of the scene's folder"):
            file_of_scene(folder, name)
    for name in ("a\0b", "loop/a"):
        with pytest.raises(InputError, match="is not a file name"):
            file_of_scene(folder, name)


def test_sizes_are_bounded_before_memory_is_allocated(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    data = io.BytesIO()
    pl.DataFrame({"a": np.zeros(10**6), "b": np.zeros(10**6)}).write_parquet(data)
    packed = data.getvalue()
    assert len(packed) < 10**5
    path = tmp_path / "bomb.parquet"
    with monkeypatch.context() as patch:
        patch.setattr(pl, "read_parquet", lambda *_, **__: pytest.fail("it is read"))
        with pytest.raises(InputError, match="more than 500,000 rows of 2 columns"):
            read_parquet(path, packed, max_values=10**6)
    assert read_parquet(path, packed, lambda name: name == "a", 10**6).shape == (10**6, 1)

    image = bytearray(exr_bytes({"depth": np.ones((3, 4), np.float32)}))
    box = image.index(b"box2i\0", image.index(b"dataWindow")) + len(b"box2i\0") + 4
    image[box : box + 16] = struct.pack("<4i", 0, 0, 99_999, 99_999)
    (tmp_path / "bomb.exr").write_bytes(image)
    with pytest.raises(InputError, match=r"has 10,000,000,000 values|not a readable EXR"):
        read_exr(tmp_path / "bomb.exr")

    monkeypatch.setattr("vbaa_bench.dataset.document._MAX_BYTES", 10)
    (tmp_path / "large.json").write_text('{"a": "0123456789"}')
    with pytest.raises(InputError, match="is too large, allowed are 10 bytes"):
        read_json(tmp_path / "large.json")


# Each unpickles only what its own parent process has sent it through a pipe, or the client of its
# Dask cluster, which sends it code in any case.
PIPES = {
    "solver/first_start.py",
    "vbaa_bench/workers/cluster.py",
    "vbaa_bench/workers/worker_process.py",
}


def test_no_file_is_unpickled() -> None:
    loaders = set()
    for path in (*modules("solver"), *modules("vbaa_bench")):
        text = path.read_text(encoding="utf-8")
        assert "allow_pickle" not in text, path
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.Attribute) and node.attr in ("load", "loads", "Unpickler"):
                names = {name.id for name in ast.walk(node) if isinstance(name, ast.Name)}
                if names & {"pickle", "marshal", "shelve", "joblib", "np", "numpy", "dill"}:
                    loaders.add(str(path.relative_to(ROOT)))
        if "pickle.load" in text:
            loaders.add(str(path.relative_to(ROOT)))
    assert loaders == PIPES


@pytest.mark.skipif(shutil.which("make") is None, reason="make is not installed")
def test_clean_never_touches_rendered_data(tmp_path: Path) -> None:
    shutil.copy(ROOT / "Makefile", tmp_path)
    for name in ("runs/mine/truth", ".venv", "build"):
        (tmp_path / name).mkdir(parents=True)
    subprocess.run(
        ["make", "clean"], cwd=tmp_path, check=True, capture_output=True, env={**os.environ}
    )
    assert (tmp_path / "runs" / "mine" / "truth").is_dir()
    assert not (tmp_path / "build").exists()
