from pathlib import Path

import numpy as np
import OpenEXR
import pytest

from solver.instrument.errors import InputError
from vbaa_bench.render.image_files import read_environment
from vbaa_bench.scene.lights.environment import plane_irradiance, rotated


def write(path: Path, **channels: np.ndarray) -> Path:
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    kept = {name: np.ascontiguousarray(c, dtype=np.float32) for name, c in channels.items()}
    with OpenEXR.File(header, kept) as file:
        file.write(str(path))
    return path


def test_an_even_sky_brings_pi_and_what_is_below_brings_nothing() -> None:
    image = np.ones((91, 40))
    assert plane_irradiance(image) == pytest.approx(np.pi, rel=1e-6)
    image[46:] = 100.0  # below the horizon, but for half a row
    assert plane_irradiance(image) == pytest.approx(np.pi, rel=0.05)


def test_a_quarter_turn_carries_plus_x_to_plus_y() -> None:
    image = np.zeros((3, 8))
    image[1, 0] = 1.0
    assert rotated(image, np.pi / 2)[1].argmax() == 2


def test_a_picture_is_read_as_luminance(tmp_path: Path) -> None:
    ramp = np.arange(6.0).reshape(2, 3)
    colour = write(tmp_path / "rgb.exr", R=ramp, G=2 * ramp, B=0 * ramp)
    assert read_environment(tmp_path, colour.name) == pytest.approx(
        (0.2126 + 2 * 0.7152) * ramp, rel=1e-6
    )
    assert read_environment(tmp_path, write(tmp_path / "y.exr", Y=ramp).name) == pytest.approx(ramp)


def test_what_is_no_picture_of_light_is_refused(tmp_path: Path) -> None:
    text = tmp_path / "text.exr"
    text.write_text("no picture", encoding="utf-8")
    ramp = np.arange(6.0).reshape(2, 3)
    whole = write(tmp_path / "whole.exr", Y=ramp).read_bytes()
    (tmp_path / "cut.exr").write_bytes(whole[: len(whole) // 2])
    for path, said in (
        (tmp_path / "none.exr", "cannot be read"),
        (text, "is not a readable EXR image|truncated"),
        (tmp_path / "cut.exr", "is not a readable EXR image|truncated"),
        (write(tmp_path / "two.exr", A=ramp, Z=ramp), "has channels A, Z, allowed are R, G, B"),
        (write(tmp_path / "negative.exr", Y=-ramp), "allowed are values that are finite"),
        (write(tmp_path / "dark.exr", Y=0 * ramp), "is dark above the horizon"),
    ):
        with pytest.raises(InputError, match=said):
            read_environment(tmp_path, path.name)
