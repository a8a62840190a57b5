"""Tracing of a beam in a photograph, against drawn beams of known centreline."""

import struct
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy.special import ndtr

from solver.instrument.arrays import Floats
from solver.instrument.errors import InputError
from solver.tracing.beam_fit import TracedBeam
from solver.tracing.traced import photograph, trace, traced_beam
from tests.draws import generator
from tests.photographed import Look, Photograph, centreline, photograph_of

SHAPE = (420, 640)
WOOD = Look(grain=8.0, texture=8.0, string=True, knots=2)
GLOSSY = Look(highlight=20.0, texture=4.0)
DARK = Look(beam=50.0, table=170.0, texture=6.0)


def drawn(
    width_px: float, look: Look, seed: int, bend: float = 0.5, scale: int = 1
) -> tuple[Photograph, TracedBeam]:
    """A photograph of a beam that bends by `bend` [rad], and what is traced in it."""
    random = generator(__name__, seed)
    shape = (scale * SHAPE[0], scale * SHAPE[1])
    clamp = scale * (np.array([70.0, 180.0]) + random.uniform(-10, 10, 2))
    line = centreline(clamp, random.uniform(-0.1, 0.05), scale * 500.0, bend, 0.8)
    photo = photograph_of(line, width_px, shape, look, random)
    # A user marks places in the image.
    clamp, tip = np.clip(photo.marks(random), 0.0, np.array(shape[::-1]) - 1.0)
    return photo, traced_beam(photo.image, clamp, tip)


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("width_px", "rmse_px", "scale"),
    [(1, 0.2, 1), (2, 0.15, 1), (5, 0.08, 1), (15, 0.05, 1), (60, 0.06, 2)],
)
def test_a_beam_on_a_plain_table_is_traced(width_px: float, rmse_px: float, scale: int) -> None:
    photo, beam = drawn(width_px, Look(), 3, scale=scale)
    off = photo.off(beam.points, beam.normals)
    assert np.sqrt(np.mean(off**2)) < rmse_px
    assert np.mean(np.abs(off) < 3 * beam.sigmas) > 0.97
    assert 40 <= len(beam.points) <= 400
    np.testing.assert_allclose(np.linalg.norm(beam.normals, axis=1), 1, atol=1e-9)
    if width_px > 4:  # a thinner one is as wide as its blur
        assert np.median(beam.widths) == pytest.approx(width_px, abs=0.15)
    along = beam.points - photo.line[0]
    assert (np.diff(np.linalg.norm(along, axis=1)) > 0).all()  # from the clamp to the tip


@pytest.mark.parametrize("blur_px", [0.4, 0.7])
@pytest.mark.parametrize("slope", [0.0, 0.1])
@pytest.mark.parametrize("width_px", [1.5, 2.0])
def test_a_thin_beam_in_a_sharp_image_is_not_traced_beside_it(
    width_px: float, slope: float, blur_px: float
) -> None:
    """Its edges are outliers to a fit with more blur than the image has."""
    fine = 8  # points per pixel
    u, v = ((np.arange(count * fine) + 0.5) / fine - 0.5 for count in (500, 160))
    for seed in range(2):
        random = generator(__name__, 31, seed)
        start = np.array([40.0, 60.0 + random.uniform(-0.5, 0.5)])
        off = np.abs(v[:, None] - start[1] - slope * (u - start[0])) / np.hypot(1, slope)
        beam = (off < width_px / 2) & (u >= start[0]) & (u <= 460)
        share = beam.reshape(160, fine, 500, fine).mean(axis=(1, 3))
        gray = 200 - 160 * cv2.GaussianBlur(share, (0, 0), blur_px)
        noisy = np.rint(gray + 2 * random.standard_normal(gray.shape)).astype(np.uint8)
        traced = traced_beam(noisy, start, start + np.array([420.0, 420.0 * slope]))
        error = traced.points[:, 1] - start[1] - slope * (traced.points[:, 0] - start[0])
        # Within one row of pixels, a beam that is narrower than they resolve can be anywhere.
        assert abs(error.mean()) < (max(4 * traced.shift_sigma, 0.02) if slope else 0.4)
        assert traced.shift_sigma < 0.3


@pytest.mark.thorough
@pytest.mark.parametrize(("width_px", "look"), [(2, DARK), (8, WOOD), (15, WOOD), (20, GLOSSY)])
def test_sigmas_hold_on_a_textured_table_with_grain(width_px: float, look: Look) -> None:
    pulls, shares = [], []
    for seed in range(4):
        photo, beam = drawn(width_px, look, 20 + seed, bend=0.6 - 0.3 * seed)
        off = photo.off(beam.points, beam.normals)
        shares.append(np.mean(np.abs(off) < 3 * beam.sigmas))
        # As a fit to independent points would have it, and a shift of all together.
        information = np.sum(beam.sigmas**-2.0)
        mean = np.sum(off / beam.sigmas**2) / information
        pulls.append(float(mean / np.hypot(information**-0.5, beam.shift_sigma)))
    assert np.mean(shares) > 0.95  # all, but for a knot or the string in one photograph of 40
    assert np.sqrt(np.mean(np.square(pulls))) < 4


def layers(colours: Floats, blur: float = 1.0) -> tuple[Floats, Floats, Floats]:
    """An image (420, 640, c) of a bent beam 14 px wide, and its clamp and tip.

    `colours` (3, 2, c) are those above, in and below the beam, at its clamp and at its tip.
    """
    v, u = np.mgrid[: SHAPE[0], : SHAPE[1]].astype(float)
    middle = 150 + 60 * ((u - 60) / 520) ** 2
    across = (v - middle) / np.hypot(1, 120 * (u - 60) / 520**2)
    part = np.clip((u - 60) / 520, 0, 1)[..., None]
    above, beam, below = (first + part * (last - first) for first, last in colours)
    upper, lower = (ndtr((across + side) / blur)[..., None] for side in (7, -7))
    image = above + upper * (beam - above) + lower * (below - beam)
    noise = generator(__name__, 9).standard_normal(image.shape)
    return image + 1.5 * noise, np.array([60.0, 150.0]), np.array([580.0, 210.0])


@pytest.mark.parametrize(
    "colours",
    [
        # Brighter than what is above and darker than what is below.
        [[[60.0], [60.0]], [[110.0], [110.0]], [[170.0], [170.0]]],
        # Darker, and then brighter, than what is above it; the place between has no upper edge.
        [[[150.0], [60.0]], [[110.0], [110.0]], [[40.0], [40.0]]],
        # As bright as the table, of another hue.
        [[[120.0, 100, 80]] * 2, [[90.0, 100, 110]] * 2, [[120.0, 100, 80]] * 2],
        # The upper edge is one of brightness, the lower one of hue.
        [[[60.0, 60, 60]] * 2, [[90.0, 100, 110]] * 2, [[120.0, 100, 80]] * 2],
    ],
)
def test_each_edge_has_a_contrast_of_its_own(colours: list[list[list[float]]]) -> None:
    image, clamp, tip = layers(np.array(colours))
    beam = traced_beam(image, clamp, tip)
    u, v = beam.points.T
    off = (v - 150 - 60 * ((u - 60) / 520) ** 2) * beam.normals[:, 1]
    assert np.sqrt(np.mean(off**2)) < 0.1
    assert np.mean(np.abs(off) < 3 * beam.sigmas) > 0.97
    assert np.median(beam.widths) == pytest.approx(14, abs=0.2)
    assert len(beam.points) > 60


def test_a_colour_image_of_equal_channels_is_a_gray_image() -> None:
    photo, _ = drawn(8, Look(), 6)
    colour = np.repeat(photo.image[..., None], 3, axis=2)
    other = traced_beam(colour, photo.line[0], photo.line[-1])
    gray = traced_beam(photo.image, photo.line[0], photo.line[-1])
    np.testing.assert_array_equal(other.points, gray.points)


def test_the_middle_of_the_edges_counts_and_not_the_brightest_line() -> None:
    photo, beam = drawn(20, Look(highlight=50.0), 1)
    off = photo.off(beam.points, beam.normals)
    assert abs(np.mean(off)) < 0.1  # the highlight is 3 px off
    assert np.median(beam.widths) == pytest.approx(20, abs=0.2)


@pytest.mark.thorough
def test_a_straight_edge_beside_the_beam_is_not_the_beam() -> None:
    for distance in (-25.0, 16.0, 30.0):
        photo, beam = drawn(10, Look(edge_px=distance), 5, bend=0.0)
        off = photo.off(beam.points, beam.normals)
        assert np.sqrt(np.mean(off**2)) < 0.1


def test_the_places_where_a_string_hides_an_edge_are_left_out() -> None:
    look = Look()
    photo, beam = drawn(15, replace(look, string=True), 2)
    _, undisturbed = drawn(15, look, 2)
    assert len(undisturbed.points) - len(beam.points) in range(len(undisturbed.points) // 2)
    assert np.abs(photo.off(beam.points, beam.normals)).max() < 0.25


def test_a_table_without_a_beam_is_refused(random: np.random.Generator) -> None:
    look = Look(texture=15.0, edge_px=12.0)
    line = np.array([[900.0, 900.0], [901.0, 900.0]])  # outside
    photo = photograph_of(line, 5, SHAPE, look, random)
    with pytest.raises(InputError, match=r"no beam is found between clamp_px \[70.0, 130.0\]"):
        traced_beam(photo.image, np.array([70.0, 130.0]), np.array([570.0, 230.0]))


@pytest.mark.parametrize(
    ("clamp", "tip", "message"),
    [
        ([-3.0, 10.0], [500.0, 10.0], "clamp_px is .-3.0, 10.0., allowed is a place in the image"),
        ([5.0, 10.0], [500.0, np.nan], "tip_px is .500.0, nan., allowed is a place in the image"),
        ([5.0, 10.0], [40.0, 10.0], "are 35 px apart, allowed are at least 40 px"),
    ],
)
def test_marks_that_cannot_be_are_refused(
    clamp: list[float], tip: list[float], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        traced_beam(np.zeros(SHAPE), np.array(clamp), np.array(tip))


def test_pixels_of_a_photograph_are_used_as_stored(tmp_path: Path) -> None:
    colour = np.zeros((48, 64, 3), np.uint8)
    colour[:] = 30, 90, 200  # blue, green, red
    jpeg = bytes(cv2.imencode(".jpg", colour, [cv2.IMWRITE_JPEG_QUALITY, 95])[1])
    # An EXIF block whose only entry is the orientation: turned by 90 degrees.
    entry = struct.pack("<HHIHH", 0x0112, 3, 1, 6, 0)
    exif = b"Exif\0\0II*\0" + struct.pack("<IH", 8, 1) + entry + struct.pack("<I", 0)
    path = tmp_path / "turned.jpg"
    path.write_bytes(jpeg[:2] + b"\xff\xe1" + struct.pack(">H", len(exif) + 2) + exif + jpeg[2:])
    for channel, gray in (("b", 30), ("g", 90), ("r", 200), ("gray", 116)):
        image = photograph(path, channel)
        assert image.shape == (48, 64)
        assert np.abs(image - gray).max() < 4
    assert (photograph(path, "lab_b") > 140).all()  # towards yellow
    assert np.abs(photograph(path) - colour).max() < 4


def test_a_rolled_camera_traces_the_same_beam() -> None:
    photo, beam = drawn(8, Look(), 6)
    height = photo.image.shape[0]

    def turned(points: Floats) -> Floats:
        return np.column_stack([height - 1 - points[:, 1], points[:, 0]])

    marks = turned(photo.line[[0, -1]])
    other = traced_beam(np.rot90(photo.image, -1), *marks)
    off = replace(photo, line=turned(photo.line)).off(other.points, other.normals)
    assert np.sqrt(np.mean(off**2)) < 0.06
    assert len(other.points) == pytest.approx(len(beam.points), abs=5)


@pytest.mark.parametrize("colour", [0, 128, 255, (30, 90, 200)])
def test_an_image_without_any_structure_shows_no_beam(colour: int | tuple[int, ...]) -> None:
    image = np.full((*SHAPE, *np.shape(colour)), colour, np.float32)
    with pytest.raises(InputError, match="no beam is found between clamp_px"):
        traced_beam(image, np.array([70.0, 180.0]), np.array([560.0, 190.0]))


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_pixels_that_are_no_numbers_are_refused(value: float) -> None:
    photo, _ = drawn(8, Look(), 6)
    image = photo.image.astype(np.float64)
    image[200, 300] = value
    with pytest.raises(InputError, match="the image holds pixels that are no numbers"):
        trace(image, (70, 180), (560, 190))
