import resource
import struct
from pathlib import Path

import numpy as np
import pytest

from solver.instrument.errors import InputError
from vbaa_bench.dataset.exr import CHANNELS, channels, exr_bytes, read_exr, write_exr


def test_layers_come_back_also_from_strided_arrays(
    tmp_path: Path, random: np.random.Generator
) -> None:
    # Transposed, flipped and sliced: OpenEXR itself would write these wrong without a word.
    layers: dict[str, np.ndarray] = {
        "radiance": random.random((40, 30)).astype(np.float16).T,
        "arc_length": random.random((60, 40)).astype(np.float32)[::2, ::-1],
        "depth": random.random((30, 80)).astype(np.float32)[:, ::2],
        "object_index": random.integers(0, 2**32, (30, 40), dtype=np.uint32)[::-1],
        "variance": random.random((30, 40)).astype(np.float32)[::-1],
        "coverage": random.random((40, 30)).astype(np.float16).T,
        "normal": random.random((40, 30, 3)).astype(np.float16).transpose(1, 0, 2),
        "occlusion": random.integers(0, 2, (30, 40)).astype(np.float16),
        "beam_mask": np.asfortranarray(random.integers(0, 2, (30, 40)).astype(np.float16)),
    }
    assert not layers["depth"].flags.c_contiguous
    path = tmp_path / "layers.exr"
    write_exr(path, layers)
    found = read_exr(path)
    assert set(found) == set(CHANNELS)
    for name, values in layers.items():
        assert found[name].dtype == CHANNELS[name][1]
        # Depth keeps sixteen significant bits, radiance eleven, the others all of their type.
        exactly = {"depth": 2.0**-16, "radiance": 2.0**-11, "variance": 2.0**-11}.get(name, 0.0)
        assert found[name] == pytest.approx(values, rel=exactly, abs=0), name


@pytest.mark.parametrize("irradiance", [1e-8, 1e-6, 1.0, 1e5, 1e6])
def test_radiance_survives_under_any_light(tmp_path: Path, irradiance: float) -> None:
    radiance = irradiance * np.linspace(0, 1, 101).reshape(1, -1)
    write_exr(tmp_path / "r.exr", {"radiance": radiance, "variance": 1e-6 * radiance**2})
    found = read_exr(tmp_path / "r.exr")
    assert found["radiance"] == pytest.approx(radiance[0], rel=2.0**-11, abs=0)
    assert found["variance"] == pytest.approx(1e-6 * radiance[0] ** 2, rel=2.0**-11, abs=0)


def test_the_same_layers_give_the_same_bytes(tmp_path: Path) -> None:
    layers = {"depth": np.arange(12, dtype=np.float32).reshape(3, 4)}
    for name in ("a.exr", "b.exr"):
        write_exr(tmp_path / name, layers)
    assert (tmp_path / "a.exr").read_bytes() == (tmp_path / "b.exr").read_bytes()


def test_a_full_disk_is_an_os_error_and_leaves_nothing(
    tmp_path: Path, random: np.random.Generator
) -> None:
    layers = {"depth": random.random((64, 64)).astype(np.float32)}
    usual = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4096, usual[1]))
    try:
        with pytest.raises(OSError, match="too large"):
            write_exr(tmp_path / "layers.exr", layers)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, usual)
    assert not list(tmp_path.iterdir())


def test_broken_files_are_named(tmp_path: Path, random: np.random.Generator) -> None:
    path = tmp_path / "layers.exr"
    write_exr(path, {"depth": random.random((64, 64)).astype(np.float32)})
    path.write_bytes(path.read_bytes()[:200])
    with pytest.raises(InputError, match=r"layers\.exr"):
        read_exr(path)
    with pytest.raises(InputError, match=r"none\.exr"):
        read_exr(tmp_path / "none.exr")


def test_the_size_in_the_header_is_checked_before_decoding(tmp_path: Path) -> None:
    path = tmp_path / "a.exr"
    data = exr_bytes({"depth": np.ones((4, 4))})
    side = struct.pack("<iiii", 0, 0, 3, 3)
    path.write_bytes(data.replace(side, struct.pack("<iiii", 0, 0, 59_999, 59_999)))
    with pytest.raises(InputError, match="has 3,600,000,000 values, allowed are 1,073,741,824"):
        read_exr(path)
    path.write_bytes(data)
    with pytest.raises(InputError, match="has 16 values, allowed are 15"):
        channels(path, max_values=15)
