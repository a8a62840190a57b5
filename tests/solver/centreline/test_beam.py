"""The beam in drawn images: found, measured, judged; truth is the line along which it was drawn."""

from dataclasses import replace
from functools import cache
from typing import Any

import cv2
import numpy as np
import pytest

from solver.centreline import Centreline, Flag, appearance
from solver.centreline.background_subtracted import CentroidExtractor, learn_centroid
from solver.centreline.extractor import BeamExtractor, learn_profile_fit
from solver.centreline.flags import fit_and_flag_outliers
from solver.centreline.rest_detection import RestDetection
from solver.instrument.arrays import Floats, Grey, Mask
from solver.instrument.errors import InputError
from tests.beam_images import (
    HEIGHT,
    METRES_PER_PIXEL,
    WIDTH,
    Look,
    Sensor,
    bent,
    distances,
    drawn,
    guide,
)
from tests.draws import generator

# The beam lies a little askew, as any beam does.
TILT = 3e-3
SENSOR = Sensor()
BRIGHT, DARK = Look(), Look().dark
UP, DIAGONAL = np.pi / 2, np.pi / 4


@cache
def rest_images(
    look: Look = BRIGHT, roll: float = 0.0, tilt: float = TILT, sensor: Sensor = SENSOR
) -> tuple[Grey, ...]:
    light = drawn(guide(roll), bent(0.0, tilt=tilt), look)
    random = generator(__name__, 1)
    return tuple(sensor(light, random) for _ in range(2))


@cache
def learned(
    look: Look = BRIGHT, roll: float = 0.0, tilt: float = TILT, sensor: Sensor = SENSOR
) -> BeamExtractor:
    return learn_profile_fit(rest_images(look, roll, tilt, sensor), guide(roll))


def pushed(
    theta: float,
    look: Look = BRIGHT,
    roll: float = 0.0,
    s_c: float = 0.6,
    ground: Floats | None = None,
    hidden: Mask | None = None,
    occluder: float = 0.1,
) -> tuple[Floats, Floats]:
    """The light of a pushed beam, and its pixels (n, 2)."""
    shape = bent(theta, s_c, TILT)
    light = drawn(guide(roll), shape, look, ground, hidden, occluder)
    return light, guide(roll).pixels(shape)


def seen(light: Floats, beam: BeamExtractor, seed: int = 2) -> Centreline:
    return beam(SENSOR(light, generator(__name__, seed)))


def errors(line: Centreline, pixels: Floats) -> Floats:
    """Signed errors (n,) across the beam, over the sigma across it."""
    tangent = np.gradient(pixels, axis=0)
    tangent /= np.hypot(*tangent.T)[:, None]
    # A column crosses an inclined beam aslant.
    nearest = np.argmin(np.hypot(*(line.points[:, None] - pixels[None, ::8]).transpose(2, 0, 1)), 1)
    along = tangent[::8][nearest]
    across = np.abs(line.directions[:, 0] * along[:, 1] - line.directions[:, 1] * along[:, 0])
    return np.asarray(distances(line.points, pixels) / (line.sigma * across))


def visible(pixels: Floats, roll: float) -> int:
    """Columns, or rows, that the beam crosses within the image."""
    camera = guide(roll).camera
    inside = ((pixels > 6) & (pixels < [camera.width - 7, camera.height - 7])).all(axis=1)
    steps = np.abs(np.diff(pixels[inside], axis=0)).max(axis=1)
    return int(steps.sum())


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("look", "roll", "theta"),
    [
        (BRIGHT, 0.0, 0.3),
        (BRIGHT, 0.0, 0.6),
        (BRIGHT, UP, 0.25),
        (BRIGHT, DIAGONAL, 0.3),
        (BRIGHT, DIAGONAL, -0.3),
        (BRIGHT, -0.57, 0.5),
        (DARK, 0.0, 0.25),
        (DARK, -0.57, 0.5),
    ],
)
def test_the_beam_is_measured_wherever_it_goes(look: Look, roll: float, theta: float) -> None:
    """Bright and dark, level, steep, and bent from the one to the other beyond 45 degrees."""
    light, pixels = pushed(theta, look, roll)
    beam = learned(look, roll)
    line = seen(light, beam)
    assert len(line.points) > 0.75 * visible(pixels, roll)
    off = np.concatenate([errors(seen(light, beam, n), pixels) for n in range(2, 8)])
    assert np.abs(off - off.mean()).max() < 9
    # The sigmas of a steep beam are a quarter too large.
    assert 0.4 < off.std() < 1.4
    assert np.median(line.sigma) < 0.025
    # Which side shines more is known to some hundredths of a pixel; at rest and bent it is the
    # same side.
    at_rest = guide(roll).pixels(bent(0.0, tilt=TILT))
    before = np.mean([distances(beam(i).points, at_rest).mean() for i in rest_images(look, roll)])
    assert abs(before) < 0.14  # +- 0.024
    assert abs(distances(line.points, pixels).mean() - before) < 0.007


def test_the_scatter_is_that_of_the_paper_s_conditions() -> None:
    light, pixels = pushed(0.25)
    beam = learned()
    assert 0.66 < light.max() < 0.74
    off = np.concatenate([distances(seen(light, beam, n).points, pixels) for n in range(5)])
    assert 0.005 < off.std() < 0.0095
    assert abs(off.mean()) < 0.04  # by the learned share of light on either side


def test_a_rest_line_along_the_rows_teaches_as_well() -> None:
    beam = learned(tilt=0.0)
    assert beam.appearance.misfit < 1.5
    light, pixels = pushed(0.25)
    off = distances(seen(light, beam).points, pixels)
    assert off.std() < 0.011
    assert abs(off.mean()) < 0.04


@pytest.mark.thorough
def test_a_beam_that_gets_thinner_is_measured_as_far_as_a_uniform_one() -> None:
    look = replace(BRIGHT, taper=-0.5)
    light, pixels = pushed(0.25, look)
    beam = learned(look)
    # A wide, round section of less taper has almost the same image.
    assert beam.appearance.section.taper == pytest.approx(look.taper, abs=0.3)
    assert beam.appearance.misfit < 1.2
    line = seen(light, beam)
    assert len(line.points) > 0.85 * len(seen(pushed(0.25)[0], learned()).points)
    # Which side shines more shifts a wide part of the beam by more, at rest and bent alike.
    at_rest = guide().pixels(bent(0.0, tilt=TILT))
    before, after = (
        np.polyfit(x.points[:, 0], distances(x.points, true), 1)
        for x, true in ((beam(rest_images(look)[0]), at_rest), (line, pixels))
    )
    middle = line.points[:, 0].mean()
    assert np.polyval(after, middle) == pytest.approx(np.polyval(before, middle), abs=0.006)
    assert after[0] * WIDTH == pytest.approx(before[0] * WIDTH, abs=0.015)
    off = (distances(line.points, pixels) - np.polyval(after, line.points[:, 0])) / line.sigma
    assert np.abs(off).max() < 8
    assert 0.6 < off.std() < 1.4
    assert learned().appearance.section.taper == pytest.approx(0.0, abs=0.05)


@pytest.mark.thorough
def test_a_path_beside_the_beam_is_moved_to_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """The beam is less than a pixel wide at its tip, and the detected line 0.9 px beside it."""
    look = replace(BRIGHT, radius_px=0.62, spread_px=0.05, roundness=1.5, taper=-0.5)
    shape = bent(0.0, tilt=-0.011)
    random, light = generator(__name__, 3), drawn(guide(), shape, look)
    paths: list[Floats] = []
    find_line, along_the_beam = appearance._find_line, appearance._along_the_beam

    def beside(*arguments: Any) -> RestDetection:
        line = find_line(*arguments)
        x = line.places[:, 0]
        y = np.interp(x, *shape.T) + 1.2 * METRES_PER_PIXEL * (x / x[-1]) ** 3
        return line._replace(places=np.column_stack([x, y]))

    def spied(*arguments: Any) -> Any:
        described = along_the_beam(*arguments)
        paths.extend([arguments[1], described.path])
        return described

    # A spline of one width does not find the thin end either.
    monkeypatch.setattr(appearance, "_sampled", lambda _: None)
    monkeypatch.setattr(appearance, "_find_line", beside)
    monkeypatch.setattr(appearance, "_along_the_beam", spied)
    learn_profile_fit([SENSOR(light, random) for _ in range(4)], guide())
    off_path = [np.abs(distances(path, guide().pixels(shape))).max() for path in paths]
    assert off_path[0] > 0.9
    assert off_path[1] < 0.1


def learned_along_a_row(
    tilt: float, offset_px: float, random: np.random.Generator
) -> tuple[Centreline, Floats]:
    """The centreline of a pushed thin beam that lay along a row of pixels, and its true pixels."""
    thin = replace(BRIGHT, radius_px=0.78, spread_px=0.05, roundness=1.5)
    at_rest, pushed_shape = (
        bent(theta, tilt=tilt, offset=offset_px * METRES_PER_PIXEL) for theta in (0.0, 0.25)
    )
    rest = drawn(guide(), at_rest, thin)
    beam = learn_profile_fit([SENSOR(rest, random) for _ in range(4)], guide())
    return seen(drawn(guide(), pushed_shape, thin), beam), guide().pixels(pushed_shape)


@pytest.mark.parametrize("offset_px", [0.2, pytest.param(0.3, marks=pytest.mark.thorough)])
def test_a_thin_beam_at_rest_along_one_row_is_measured_as_far(
    offset_px: float, random: np.random.Generator
) -> None:
    # It crosses a quarter of a row, which leaves its width, roundness and skew almost undetermined.
    line, pixels = learned_along_a_row(1e-3, offset_px, random)
    assert len(line.points) > 200
    assert distances(line.points, pixels).std() < 0.014


@pytest.mark.thorough
@pytest.mark.parametrize("offset_px", [0.0, 0.2, 0.9])
def test_columns_that_a_beam_along_one_row_did_not_show_are_not_foreign(
    offset_px: float, random: np.random.Generator
) -> None:
    """Its profile was seen at one place between the pixels: elsewhere it fits less well."""
    line, pixels = learned_along_a_row(2e-4, offset_px, random)
    assert len(line.points) > 200
    assert distances(line.points, pixels).std() < 0.1


@pytest.mark.thorough
def test_sixteen_bits_say_what_eight_do() -> None:
    deep = Sensor(bits=16)
    light, pixels = pushed(0.25)
    line = learned(sensor=deep)(deep(light, generator(__name__, 2)))
    assert distances(line.points, pixels).std() < 0.011
    shallow = seen(light, learned())
    # The same electrons, but for rounding.
    columns, a, b = np.intersect1d(line.points[:, 0], shallow.points[:, 0], return_indices=True)
    assert len(columns) > 220
    assert np.std(line.points[a, 1] - shallow.points[b, 1]) < 0.006


@pytest.mark.parametrize("occluder", [0.02, 0.12, 0.6])
def test_hidden_stretches_are_rejected_and_nothing_else(occluder: float) -> None:
    hidden = np.zeros((HEIGHT, WIDTH), bool)
    hidden[:, 90:110] = True
    # An edge that runs along the beam for a while, and over it at last.
    v, u = np.mgrid[:HEIGHT, :WIDTH]
    light, pixels = pushed(0.2)
    middle = np.interp(u, pixels[:, 0], pixels[:, 1])
    hidden |= (u > 170) & (u < 205) & (v < middle - 1.0 + 0.15 * (u - 180))
    light, pixels = pushed(0.2, hidden=hidden, occluder=occluder)
    line = seen(light, learned())
    column = np.rint(line.points[:, 0]).astype(int)
    row = np.rint(line.points[:, 1]).astype(int)
    assert not hidden[row, column].any()
    off = distances(line.points, pixels)
    assert np.abs(off).max() < 0.08
    assert off.std() < 0.013
    clear = np.r_[26:84, 116:165, 212:285]
    assert np.isin(clear, column).mean() > 0.75
    rejected = np.rint(line.rejected[:, 0]).astype(int)
    assert np.isin(np.arange(91, 109), rejected).all()
    inside = line.flags[(rejected > 92) & (rejected < 107)]
    assert np.isin(inside, [Flag.HIDDEN, Flag.FOREIGN]).all()
    assert np.mean(inside == Flag.HIDDEN) > 0.5


def test_the_light_that_is_lost_between_occluders_is_said() -> None:
    light, _ = pushed(0.2)
    u = np.arange(WIDTH)
    # Dark beside occluders that are 50 px apart, which leave a fifth less light at their edges.
    lost = 0.2 * ((u % 50 - 25) / 25) ** 4
    line = seen(light * (1 - lost), learned())
    column = np.rint(line.points[:, 0]).astype(int)
    assert len(column) > 120
    assert np.abs(line.lost_light - lost[column]).mean() < 0.02
    assert np.abs(line.lost_light - lost[column]).max() < 0.12
    clear = seen(light, learned())
    assert clear.lost_light.max() < 0.1
    assert np.median(clear.lost_light) < 0.03


def test_a_short_stretch_that_is_darker_than_the_others_is_foreign() -> None:
    light, _ = pushed(0.2)
    u = np.arange(WIDTH)
    hidden = ((u > 120) & (u < 150)) | ((u > 160) & (u < 200))
    dark = (u >= 150) & (u <= 160)
    light[:, hidden] = light.min()
    light[:, dark] *= 0.8
    line = seen(light, learned())
    column = np.rint(line.points[:, 0]).astype(int)
    assert not dark[column].any()
    assert np.isin(np.r_[40:110, 210:270], column).mean() > 0.8


def test_a_glare_beside_the_beam_pulls_no_point_away() -> None:
    light, pixels = pushed(0.25)
    v, u = np.mgrid[:HEIGHT, :WIDTH]
    at = pixels[np.argmin(np.abs(pixels[:, 0] - 150))] + [0.0, 3.0]
    glare = 1.5 * np.exp(-((u - at[0]) ** 2 + (v - at[1]) ** 2) / (2 * 4.0**2))
    line = seen(light + glare, learned())
    off = distances(line.points, pixels)
    assert np.abs(off).max() < 0.1
    far = np.abs(line.points[:, 0] - at[0]) > 25
    assert np.count_nonzero(far) > 0.75 * (visible(pixels, 0.0) - 50)
    lost = np.abs(line.rejected[:, 0] - at[0]) < 4
    assert np.isin(line.flags[lost], [Flag.SATURATED, Flag.FOREIGN]).all()
    assert np.count_nonzero(line.flags[lost] == Flag.SATURATED) >= 3


def test_an_overexposed_beam_is_measured_by_its_flanks() -> None:
    look = Look(beam=1.6)
    light, pixels = pushed(0.25, look)
    assert np.count_nonzero(light > 1) > 100
    line = seen(light, learned(look))
    assert len(line.points) > 0.8 * visible(pixels, 0.0)
    off = errors(line, pixels)
    assert np.abs(off).max() < 11
    assert off.std() < 1.8


@pytest.mark.parametrize("size", [5, 16])
def test_a_textured_ground_is_no_beam(size: int) -> None:
    v, u = np.mgrid[:HEIGHT, :WIDTH]
    chequered = 0.05 + 0.1 * (((u // size) + (v // size)) % 2)
    light, pixels = pushed(0.25, ground=chequered)
    line = seen(light, learned())
    off = distances(line.points, pixels)
    assert len(off) > 0.6 * visible(pixels, 0.0)
    assert np.abs(off).max() < 0.4
    assert np.sqrt(np.mean(errors(line, pixels) ** 2)) < 1.8


def test_other_thin_things_are_not_the_beam() -> None:
    v, u = np.mgrid[:HEIGHT, :WIDTH]
    # A brighter cable across the image, and one beside the beam.
    cables = 0.9 * (np.abs(v - 10 - 0.33 * u) < 1.2) + 0.9 * (np.abs(v - 100 + 0.1 * u) < 0.8)
    light, pixels = pushed(0.25, ground=0.05 + 0.9 * np.minimum(cables, 1.0))
    off = distances(seen(light, learned()).points, pixels)
    assert len(off) > 0.7 * visible(pixels, 0.0)
    assert np.abs(off).max() < 0.1


def test_a_beam_that_leaves_the_image_is_measured_within_it() -> None:
    light, pixels = pushed(0.6, s_c=0.4)
    assert pixels[-1, 1] < -20
    line = seen(light, learned())
    assert len(line.points) > 0.75 * visible(pixels, 0.0)
    assert (line.points[:, 1] > 2).all()
    assert (line.rejected > -0.5).all()
    assert line.tip is None
    assert np.abs(errors(line, pixels)).max() < 5


@pytest.mark.parametrize("kind", ["black", "white", "ground", "noise", "edge"])
def test_an_image_without_the_beam_shows_none(kind: str, random: np.random.Generator) -> None:
    v = np.mgrid[:HEIGHT, :WIDTH][0]
    light = {
        "black": np.zeros((HEIGHT, WIDTH)),
        "white": np.full((HEIGHT, WIDTH), 2.0),
        "ground": np.full((HEIGHT, WIDTH), 0.05),
        "noise": random.uniform(0, 0.6, (HEIGHT, WIDTH)),
        "edge": np.where(v > HEIGHT / 2, 0.8, 0.05),
    }[kind]
    line = seen(light, learned())
    assert len(line.points) <= 3
    assert line.tip is None


@pytest.mark.parametrize("light", [0.0, pytest.param(0.05, marks=pytest.mark.thorough), 2.0])
def test_rest_images_without_a_beam_are_refused(light: float) -> None:
    images = [SENSOR(np.full((HEIGHT, WIDTH), light), generator(__name__, n)) for n in (1, 2)]
    with pytest.raises(InputError, match="beam"):
        learn_profile_fit(images, guide())


def test_the_mirrored_image_has_the_mirrored_beam(random: np.random.Generator) -> None:
    light, _ = pushed(0.25)
    image = SENSOR(light, random)
    line = learned()(image)
    rests = [np.ascontiguousarray(rest[::-1]) for rest in rest_images()]
    mirrored = learn_profile_fit(rests, guide())(np.ascontiguousarray(image[::-1]))
    columns, a, b = np.intersect1d(line.points[:, 0], mirrored.points[:, 0], return_indices=True)
    assert len(columns) > 0.97 * len(line.points)
    apart = line.points[a, 1] - (HEIGHT - 1 - mirrored.points[b, 1])
    # The side that shines more is known to some thousandths of a pixel, and may be either.
    assert np.abs(apart).max() < 0.02


@pytest.mark.thorough
def test_gain_and_offset_of_the_gray_values_change_nothing(random: np.random.Generator) -> None:
    light, pixels = pushed(0.25)
    image = SENSOR(light, random)
    line = learned()(image)

    def other(gray: Grey) -> Grey:
        return np.asarray(100 * gray.astype(np.uint16) + 3000, np.uint16)

    # A pixel at full scale, by which the depth of the image is known.
    rests = [other(rest) for rest in rest_images()]
    for rest in rests:
        rest[0, 0] = 65535
    found = learn_profile_fit(rests, guide())(other(image))
    columns, a, b = np.intersect1d(line.points[:, 0], found.points[:, 0], return_indices=True)
    assert len(columns) > 0.97 * len(line.points)
    assert np.abs(line.points[a, 1] - found.points[b, 1]).max() < 0.01
    assert np.abs(distances(found.points, pixels)).max() < 0.07


@pytest.mark.parametrize(
    ("look", "roll"),
    [(BRIGHT, 0.0), pytest.param(DARK, 0.0, marks=pytest.mark.thorough), (BRIGHT, UP)],
)
def test_the_centroid_finds_the_same_beam_less_sharply(
    look: Look, roll: float, random: np.random.Generator
) -> None:
    light, pixels = pushed(0.25, look, roll)
    image = SENSOR(light, random)
    fitted = learned(look, roll)(image)
    line = CentroidExtractor(learned(look, roll))(image)
    assert len(line.points) == len(fitted.points)
    off = distances(line.points, pixels)
    assert 0.007 < off.std() < (0.03 if look is BRIGHT else 0.12)
    assert off.std() > 1.1 * distances(fitted.points, pixels).std()
    assert 0.7 < errors(line, pixels).std() < 1.35
    assert abs(off.mean()) < 0.006 + 6 * off.std() / np.sqrt(len(off))


def test_the_centroid_rejects_what_is_overexposed(random: np.random.Generator) -> None:
    look = Look(beam=1.6)
    light, pixels = pushed(0.25, look)
    line = learn_centroid(rest_images(look), guide())(SENSOR(light, random))
    over = np.unique(np.nonzero(light > 1.05)[1])
    assert len(over) > 50
    assert not np.isin(over, np.rint(line.points[:, 0])).any()
    assert np.count_nonzero(line.flags == Flag.SATURATED) > 50
    assert np.abs(errors(line, pixels)).max() < 7


@pytest.mark.parametrize("theta", [-0.38, 0.38])
def test_the_centroid_leaves_out_columns_that_the_image_cuts_off(theta: float) -> None:
    """The beam leaves the image above or below."""
    light, pixels = pushed(theta)
    extract, random = learn_centroid(rest_images(), guide()), generator(__name__, 3)
    for _ in range(4):
        line = extract(SENSOR(light, random))
        assert len(line.points) > 150
        assert np.abs(distances(line.points, pixels)).max() < 0.5


def compressed(image: Grey, quality: int) -> Grey:
    """An image as JPEG leaves it."""
    _, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])
    return np.asarray(cv2.imdecode(data, cv2.IMREAD_GRAYSCALE))


@pytest.mark.thorough
@pytest.mark.parametrize("quality", [85, 50])
def test_points_of_a_compressed_image_have_honest_sigmas(quality: int) -> None:
    """Those of the sensor's noise are too small several times over.

    What all points have in common is that of the rest images, too.
    """
    light, pixels = pushed(0.25)
    beam = learn_profile_fit([compressed(image, quality) for image in rest_images()], guide())
    frames = [SENSOR(light, generator(__name__, n)) for n in range(2, 6)]
    lines = [beam(compressed(frame, quality)) for frame in frames]
    # 1.7 and 2.0: the errors of a block are not those of its neighbours' noise alone.
    assert 0.5 < np.mean([errors(line, pixels).var() for line in lines]) < 4.5
    assert all(0 < line.common_sigma < 0.01 for line in lines)


def test_a_clean_beam_in_a_compressed_frame_has_honest_sigmas() -> None:
    """The rest images do not show what a compressed frame's points err by: the frame does."""
    light, pixels = pushed(0.25)
    frames = [SENSOR(light, generator(__name__, n)) for n in range(2, 6)]
    lines = [learned()(compressed(frame, 50)) for frame in frames]
    chi2 = [np.mean(errors(line, pixels) ** 2) for line in lines]
    assert 0.4 < np.mean(chi2) < 2.0


def test_a_centroid_has_no_grid_error_of_the_fit() -> None:
    centroid = learn_centroid([compressed(image, 80) for image in rest_images()], guide())
    light, _ = pushed(0.25)
    frame = compressed(SENSOR(light, generator(__name__, 2)), 80)
    assert centroid.beam(frame).grid_error is not None
    assert centroid(frame).grid_error is None


@pytest.mark.parametrize(("theta", "s_c"), [(0.7, 0.3), (-0.7, 0.3)])
def test_sigmas_of_a_beam_that_leaves_the_image_are_those_of_its_noise(
    theta: float, s_c: float, random: np.random.Generator
) -> None:
    """Its course beyond the border is no measurement."""
    light, pixels = pushed(theta, s_c=s_c)
    line = learned()(SENSOR(light, random))
    assert len(line.points) > 60  # of the 98 that are in the image
    # A single frame: between 0.35 and 1.25 in six.
    assert 0.2 < np.mean(errors(line, pixels) ** 2) < 2.5
    assert np.median(line.sigma) < 0.04


def test_points_read_by_rows_and_by_columns_have_one_common_error() -> None:
    """A beam at 45 degrees crosses as many pixel rows as columns, in whichever it is read."""
    shared = []
    for theta in (0.6, 0.95):
        light, _ = pushed(theta, roll=DIAGONAL / 2)
        frame = SENSOR(light, generator(__name__, 5))
        shared.append(learned(roll=DIAGONAL / 2)(compressed(frame, 50)).common_sigma)
    assert 0 < shared[1] < 2 * shared[0]
    assert shared[1] > shared[0] / 2


def test_white_noise_does_not_enlarge_its_own_sigma(random: np.random.Generator) -> None:
    n = 250
    length, even = np.arange(n, dtype=np.float64), np.ones(n)
    for scale, least, most in ((1.0, 1.0, 1.0), (2.0, 1.5, 2.5)):
        enlarged = []
        for _ in range(200):
            sigma = np.full(n, 0.01)
            off = scale * sigma * random.standard_normal(n)
            fit_and_flag_outliers(
                length, off, sigma, even, np.ones(n, np.bool_), np.zeros(n, np.uint8)
            )
            enlarged.append(sigma[0] / 0.01)
        # By chance a sigma is enlarged in one image of a thousand; twice the scatter is known to
        # 1.63 / sqrt(n), a tenth.
        assert np.mean(np.array(enlarged) < least) < 0.1
        assert np.mean(np.array(enlarged) > most) < 0.1


def test_a_beam_bent_by_two_contacts_does_not_enlarge_its_sigma(
    random: np.random.Generator,
) -> None:
    n = 400
    place = np.linspace(0.0, 1.0, n)
    # The third derivative has a step at each contact.
    bend = 600.0 * np.maximum(place - 0.3, 0.0) ** 3 - 1800.0 * np.maximum(place - 0.7, 0.0) ** 3
    sigma, flags = np.full(n, 0.01), np.zeros(n, np.uint8)
    off: Floats = bend + sigma * random.standard_normal(n)
    length = np.arange(n, dtype=np.float64)
    fit_and_flag_outliers(length, off, sigma, np.ones(n), np.ones(n, np.bool_), flags)
    # A polynomial of degree 7 leaves 3.9 times the noise.
    assert sigma[0] < 0.02  # 0.0137 +- 0.0009
    assert not flags.any()
