"""A fingerprint knows frames again but for rounding, and no other frames."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from solver.instrument.files import write_bytes
from tests.sealing import reseal
from tests.vbaa_bench.stored import store
from vbaa_bench.dataset.fingerprint import Compared, compare, fingerprint
from vbaa_bench.dataset.layout import Layout

FRAMES = 12
NOISE_GRAY = 1.0
SHAPE = (200, 300)


@pytest.fixture
def layout(tmp_path: Path, random: np.random.Generator) -> Layout:
    """A dataset with images of noise about a gray value."""
    layout = Layout(store(tmp_path / "data", FRAMES))
    for path in images(layout):
        write(path, noise(random))
    reseal(layout)
    return layout


def images(layout: Layout) -> list[Path]:
    return sorted(layout.observations.rglob("*.png"))


def noise(random: np.random.Generator) -> np.ndarray:
    return np.clip(np.rint(random.normal(200, NOISE_GRAY, SHAPE)), 0, 255).astype(np.uint8)


def write(path: Path, image: np.ndarray) -> None:
    write_bytes(path, cv2.imencode(".png", image)[1].tobytes())


def test_other_last_digits_and_a_few_other_pixels_are_rounding(layout: Layout) -> None:
    known = fingerprint(layout.root)
    assert compare(layout.root, known) == Compared(FRAMES, FRAMES, FRAMES, True)
    assert compare(layout.root, known).exact
    first = images(layout)[0]
    image = cv2.imread(str(first), cv2.IMREAD_UNCHANGED)
    assert image is not None
    image[3, 5:8] += 2
    write(first, image)
    table = first.parent / "metadata.csv"
    text = table.read_text(encoding="utf-8")
    assert "-1.5," in text
    table.write_text(text.replace("-1.5,", "-1.5000000000000002,"), encoding="utf-8")
    reseal(layout)
    compared = compare(layout.root, known)
    assert compared == Compared(FRAMES, FRAMES - 1, FRAMES, True)
    assert not compared.exact


def test_other_noise_and_other_readings_are_not(
    layout: Layout, random: np.random.Generator
) -> None:
    known = fingerprint(layout.root)
    for path in images(layout):
        write(path, noise(random))
    table = images(layout)[0].parent / "metadata.csv"
    text = table.read_text(encoding="utf-8")
    table.write_text(text.replace("-1.5,", "-1.500001,"), encoding="utf-8")
    reseal(layout)
    compared = compare(layout.root, known)
    # Of a sum whose sigma is 346, within 19 by chance; more than eight of twelve: 1e-8.
    assert compared.rounded <= 8
    assert not compared.others


def test_a_missing_image_leaves_none_equal(layout: Layout) -> None:
    known = fingerprint(layout.root)
    images(layout)[0].unlink()
    reseal(layout)
    assert compare(layout.root, known)[:3] == (FRAMES, 0, 0)
