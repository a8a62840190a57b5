"""The door of an observations tree: tables and images that are odd, damaged or malicious."""

import os
import shutil
import struct
import zlib
from pathlib import Path
from random import Random

import cv2
import numpy as np
import pytest

from solver.instrument.errors import LONGEST_SHOWN, InputError
from solver.instrument.hashes import HASHES
from solver.instrument.image_frame import NO_READINGS, ImageFrame
from solver.instrument.images import png_bytes, read_grey
from solver.instrument.metadata import read_frames
from solver.instrument.observation import open_observations, open_rig_files
from tests.draws import scene_seed
from vbaa_bench.dataset.exr import channels
from vbaa_bench.dataset.scene_files import read_file

COLUMNS = (
    "file_name,frame_id,motor_angle_deg,push_id,step,removed_from_mm,removed_to_mm,"
    "moment_y_n_mm,base_force_x_n,base_force_y_n,base_force_z_n"
)
CELLS = "a.png,mine,30.5,p,0,1,2,3,4,5,6"
ODD = (
    *('"', '""', "\0", "\n", "\r", ",", ";", "nan", "-inf", "1e400", "-1", "9" * 5000, "1,5"),
    *("x" * 200_000, f"{'a' * 10_000}.png", "../../a.png", "/etc/passwd", "\ufeff", "1e22", "."),
)


@pytest.fixture
def table(tmp_path: Path) -> Path:
    """A table's path, beside the one image a.png."""
    (tmp_path / "a.png").write_bytes(png_bytes(np.zeros((4, 5), np.uint8)))
    return tmp_path / "metadata.csv"


def read(table: Path, text: str) -> list[ImageFrame]:
    table.write_text(text, encoding="utf-8")
    return list(read_frames(table))


def test_a_table_without_the_column_of_images_is_named(table: Path) -> None:
    with pytest.raises(InputError, match=r"csv: the column file_name is missing; did you mean it "):
        read(table, "filename,motor_angle_deg\na.png,1\n")
    with pytest.raises(InputError, match=r"csv: the column file_name is missing$"):
        read(table, "motor_angle_deg\n1\n")


def test_mutated_tables_are_read_or_refused(table: Path) -> None:
    chance = Random(scene_seed(12))
    refusals: list[str] = []
    for _ in range(500):
        cells = [COLUMNS.split(","), CELLS.split(",")]
        for _ in range(chance.randint(1, 3)):
            row = chance.choice(cells)
            at = chance.randrange(len(row))
            row[at] = chance.choice([chance.choice(ODD), row[at] + chance.choice(ODD)])
        try:
            read(table, "\n".join(",".join(row) for row in cells))
        except InputError as error:
            refusals.append(str(error).replace(str(table.parent), ""))
    assert 100 < len(refusals) < 500
    assert max(map(len, refusals)) < 3 * LONGEST_SHOWN


@pytest.mark.parametrize(
    ("cells", "said"),
    [
        (f"{'a' * 10_000}.png", "is missing"),
        ("../a.png", "file_name is '../a.png', allowed is a file beside the table"),
        ("/etc/passwd", "allowed is a file beside the table"),
        (f"a.png,{'x' * 200_000}", "is not CSV (field larger than field limit (131072))"),
        (f"a.png,{'x' * 1000}", "frame_id has 1000 characters, allowed are 250"),
        (f"a.png,,{'x' * 1000}", "..., allowed is a finite number"),
    ],
)
def test_a_row_that_cannot_be_used_is_named(table: Path, cells: str, said: str) -> None:
    with pytest.raises(InputError) as caught:
        read(table, f"file_name,frame_id,motor_angle_deg\n{cells}\n")
    assert said in str(caught.value)
    assert f"{table}:2: " in str(caught.value)


def test_what_excel_writes_is_read(table: Path) -> None:
    text = f"\ufeff{COLUMNS}\r\n{CELLS}\r\n"
    (plain,) = read(table, f"{COLUMNS}\n{CELLS}\n")
    assert read(table, text) == [plain]
    assert read(table, text.replace(",", ";")) == [plain]
    # In Germany, and as "Unicode text".
    german = text.replace(",", ";").replace("30.5", "30,5")
    assert read(table, german) == [plain]
    for encoding in ("utf-16-le", "utf-16-be"):  # after a byte order mark
        table.write_bytes(german.replace(";", "\t").encode(encoding))
        assert list(read_frames(table)) == [plain]


def test_what_excel_writes_ambiguously_is_refused_with_a_remedy(table: Path) -> None:
    def refused(content: str | bytes) -> str:
        table.write_bytes(content.encode() if isinstance(content, str) else content)
        with pytest.raises(InputError) as caught:
            list(read_frames(table))
        return str(caught.value)

    head = "file_name,motor_angle_deg"
    assert "write decimal points" in refused(f"{head}\na.png,30,5\n")
    assert "with a decimal point" in refused(f'{head}\na.png,"30,5"\n')
    assert "with a decimal point" in refused("file_name;motor_angle_deg\na.png;1.030,5\n")
    assert "is UTF-16 without" in refused(f"{head}\na.png,30\n".encode("utf-16-le"))
    assert "save it as 'CSV UTF-8'" in refused("file_name\nTür.png\n".encode("cp1252"))


def test_pipes_are_no_files(tmp_path: Path) -> None:
    for name in ("metadata.csv", "mesh.stl", "sky.exr"):
        os.mkfifo(tmp_path / name)
    with pytest.raises(InputError, match="it is not a regular file"):
        list(read_frames(tmp_path / "metadata.csv"))
    with pytest.raises(InputError, match="it is not a regular file"):
        read_file(tmp_path, "mesh.stl", "mesh")
    with pytest.raises(InputError, match="it is not a regular file"):
        channels(tmp_path / "sky.exr")


def test_two_frames_of_one_name_are_refused(dataset: Path, tmp_path: Path) -> None:
    root = tmp_path / "observations"
    shutil.copytree(dataset / "observations", root, ignore=shutil.ignore_patterns(HASHES))
    for path in root.glob("shard_*/metadata.csv"):  # one in each shard
        lines = path.read_text(encoding="utf-8").splitlines()
        cells = lines[1].split(",")
        lines[1] = ",".join([cells[0], "twin", *cells[2:]])
        path.write_text("\n".join(lines), encoding="utf-8")
    with pytest.raises(InputError, match="2 frames have the frame_id 'twin', allowed is one each"):
        open_observations(root)


@pytest.mark.parametrize("deep", ["rest", "shard_*"])
def test_frames_and_rest_images_of_two_depths_are_refused(
    dataset: Path, tmp_path: Path, deep: str
) -> None:
    root = tmp_path / "observations"
    shutil.copytree(dataset / "observations", root)
    images = sorted(root.glob(f"{deep}/*.png"))
    for path in images:
        path.write_bytes(png_bytes(read_grey(path).astype(np.uint16) * 16))
    with pytest.raises(InputError, match="allowed are frames and rest images of one depth"):
        open_observations(root)
    if deep == "rest":
        images[0].write_bytes((dataset / "observations/rest" / images[0].name).read_bytes())
        with pytest.raises(InputError, match="allowed are rest images of one depth"):
            open_rig_files(root)
    else:  # one frame that differs is that frame's own matter
        shutil.copy(dataset / "observations" / images[0].relative_to(root), images[0])
        assert len(open_observations(root).frames) == 4


def test_images_of_the_ground_have_a_place(dataset: Path, tmp_path: Path) -> None:
    for folder in ("calibration", "rest"):
        shutil.copytree(dataset / "observations" / folder, tmp_path / folder)
    shutil.copy(dataset / "observations" / "rig.json", tmp_path)
    assert open_rig_files(tmp_path).ground_images == ()
    shutil.copytree(tmp_path / "rest", tmp_path / "ground")
    for path in (tmp_path / "ground").iterdir():
        path.rename(path.with_name(path.name.replace("rest", "ground")))
    names = [path.name for path in open_rig_files(tmp_path).ground_images]
    assert names == ["ground_00.png", "ground_01.png"]
    cv2.imwrite(str(tmp_path / "ground" / "ground_02.jpg"), np.zeros((4, 5), np.uint8))
    with pytest.raises(InputError, match=r"ground_02\.jpg: has 5 x 4 px, allowed is the size of"):
        open_rig_files(tmp_path)


def test_a_png_that_claims_to_be_huge_is_not_decoded(tmp_path: Path) -> None:
    def chunk(kind: bytes, data: bytes) -> bytes:
        return (
            struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        )

    path = tmp_path / "huge.png"
    for size, said in ((65_000, "has 65000 x 65000 px, allowed are 200,000,000 px"), (0, "not")):
        head = struct.pack(">IIBBBBB", size, size, 8, 0, 0, 0, 0)
        ends = chunk(b"IDAT", zlib.compress(b"\0")) + chunk(b"IEND", b"")
        path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + ends)
        with pytest.raises(InputError, match=said):
            read_grey(path)


def test_a_laboratorys_frames_are_in_images(dataset: Path, tmp_path: Path) -> None:
    tree = dataset / "observations"
    for part in ("calibration", "rest"):
        shutil.copytree(tree / part, tmp_path / part)
    shutil.copy(tree / "rig.json", tmp_path)
    shutil.copytree(tree / "shard_00000", tmp_path / "images")
    opened = open_observations(tmp_path).frames
    first = [frame for frame in open_observations(tree).frames if "00000" in frame.path.parent.name]
    assert [(f.frame_id, f.readings, f.push_id) for f in opened] == [
        (f.frame_id, f.readings, f.push_id) for f in first
    ]
    (tmp_path / "images" / "metadata.csv").unlink()
    without_table = open_observations(tmp_path).frames
    assert [f.frame_id for f in without_table] == sorted(f.frame_id for f in first)
    assert {f.readings for f in without_table} == {NO_READINGS}
    # Of a generated tree, which lists its files, images beside them are none of its frames.
    shutil.copytree(tree, tmp_path / "generated")
    shutil.copytree(tmp_path / "images", tmp_path / "generated" / "images")
    generated = open_observations(tmp_path / "generated").frames
    assert len(generated) == len(open_observations(tree).frames)
