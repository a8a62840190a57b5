import math
from dataclasses import replace

import numpy as np
import pytest

from solver.at_rest.agreement import disagreements
from solver.at_rest.rest_line import SMALL_BOW_PX, fit_rest_line
from solver.at_rest.rest_points import without_grid_error
from solver.calibrate import Calibration
from solver.centreline import Centreline, down_columns
from solver.centreline.section_on_ground import GroundErrors
from solver.instrument.beam_shape import UNIFORM
from solver.instrument.camera import Camera
from solver.instrument.errors import InputError
from solver.instrument.grid_error import GridError
from solver.instrument.transforms import camera_looking_at
from tests.draws import generator
from tests.simulated import BEAM, rig
from tests.solver.planes.test_sag import CAMERA

# Whose rows run along the beam.
LEVEL = replace(
    CAMERA,
    camera_from_antenna=camera_looking_at(
        np.array([0.12, 0.0, 0.36]), np.array([0.12, 0.0, 0.0]), 0.0
    ),
)
SIGMA_PX = 0.01
# Of the camera LEVEL on plane C [m].
PIXEL = 1 / float(LEVEL.pixels_per_metre(np.array([[0.12, 0.0, 0.0]]))[0])
X = np.linspace(0.004, 0.238, 420)
# Root mean square of t^2 about a line, for t from 0 to 1.
PARABOLA = 180**-0.5


def lines(
    y: np.ndarray, random: np.random.Generator, count: int = 4, camera: Camera = CAMERA
) -> list[Centreline]:
    """Images of a beam that lies along y(x) [m] on C: one point a column, with noise."""
    pixels = camera.project(np.column_stack([X, y, np.zeros_like(X)]))
    columns = np.arange(np.ceil(pixels[0, 0]), np.floor(pixels[-1, 0]))
    rows = np.interp(columns, pixels[:, 0], pixels[:, 1])
    sigma = np.full(len(columns), SIGMA_PX)
    return [
        down_columns(
            np.column_stack([columns, rows + SIGMA_PX * random.standard_normal(len(rows))]), sigma
        )
        for _ in range(count)
    ]


@pytest.mark.thorough
def test_a_straight_beam_is_a_line_with_honest_covariance(random: np.random.Generator) -> None:
    errors = []
    for _ in range(350):
        rest = fit_rest_line(lines(2e-5 + 1e-3 * X, random), Calibration(CAMERA, 0.02), rig())
        assert not rest.bow.any()
        error = np.array([rest.y_at_clamp - 2e-5, rest.slope - 1e-3])
        errors.append(error @ np.linalg.solve(rest.line_covariance, error))
    assert 1.4 < np.mean(errors) < 2.7  # chi^2 of two degrees of freedom: 2 +- 0.11


def test_a_bow_is_found_and_told_apart_from_the_clamp(random: np.random.Generator) -> None:
    bow = 3e-4 * (X / BEAM.length) ** 2
    rest = fit_rest_line(lines(1e-3 * X + bow, random), Calibration(CAMERA, 0.02), rig())
    assert rest.bow.any()
    found, sigma = rest.bow_at(X)
    whole = rest.y_at_clamp + rest.slope * X + found
    assert np.abs(whole - 1e-3 * X - bow).max() < 5e-6
    assert sigma.max() < 2e-6
    # Slope and bow vary together; the line through the curve's error is known far better.
    assert rest.line_covariance[1, 1] < rest.covariance[1, 1] / 25


def test_too_few_columns_are_a_sentence() -> None:
    few = [down_columns(np.array([[30.0, 250.0], [31.0, 250.0]]), np.full(2, SIGMA_PX))]
    with pytest.raises(InputError, match="2 columns of the beam, needed are 10"):
        fit_rest_line(few, Calibration(CAMERA, 0.02), rig())


def test_an_image_in_which_the_beam_bends_is_named(random: np.random.Generator) -> None:
    four = lines(1e-3 * X, random)
    touched = four[2].points.copy()
    touched[:, 1] += 0.5 * np.linspace(0, 1, len(touched)) ** 2
    four[2] = down_columns(touched, four[2].sigma)
    off = disagreements(four)
    assert off[2] == pytest.approx(0.5, abs=0.02)
    assert not off[[0, 1, 3]].any()


def test_grid_errors_that_are_fitted_differently_are_no_disagreement(
    random: np.random.Generator,
) -> None:
    """Where the beam hardly crosses a row, each image gives another error and another course."""
    images = []
    for line, size in zip(
        lines(1e-3 * X, random, camera=LEVEL), (0.0, 0.1, -0.1, 0.2), strict=True
    ):
        own = GridError(True, np.array([[0.0, 0.25]]), np.array([size, 0.0]), 1e-4 * np.eye(2))
        along, across = line.points.T
        smooth = np.polynomial.Polynomial.fit(along, across, 4)(along)
        left = np.column_stack([along, across - own.at(along, smooth)])
        images.append(replace(line, points=left, grid_error=own))
    assert not disagreements(images).any()
    assert disagreements([replace(line, grid_error=None) for line in images]).any()


def test_noise_alone_is_no_disagreement(random: np.random.Generator) -> None:
    for _ in range(200):
        assert not disagreements(lines(1e-3 * X, random)).any()


def test_errors_that_repeat_from_image_to_image_count_in_the_covariance(
    random: np.random.Generator,
) -> None:
    """They follow the pixel rows: a beam that crosses R rows shows R + 1 of them, at any number.

    What they have in common the line cannot show.
    """
    chi2 = []
    place = np.linspace(0, BEAM.length, 50)
    for _ in range(150):
        slope = random.uniform(4e-3, 9e-3)
        rows = slope * 455  # the image has 455 columns
        phase = random.uniform(0, 2 * np.pi)
        shared = 0.02 * np.sqrt(0.5 / (rows + 1)) * random.standard_normal()
        wrong = []
        for line in lines(slope * X, random, camera=LEVEL):
            points = line.points.copy()
            points[:, 1] += 0.02 * np.sin(2 * np.pi * points[:, 1] + phase) + shared
            wrong.append(down_columns(points, line.sigma))
        rest = fit_rest_line(wrong, Calibration(LEVEL, 0.02), rig())
        off = rest.y_at_clamp + (rest.slope - slope) * place + rest.bow_at(place)[0]
        error = np.polynomial.polynomial.polyfit(place, off, 1)
        chi2.append(error @ np.linalg.solve(rest.line_covariance, error))
    # chi^2 of two degrees of freedom; for independent errors alone it is 15. It is 0.6: the shared
    # error is stated for the worst phase.
    assert 0.25 < np.mean(chi2) < 4.0


@pytest.mark.parametrize("rows", [0.3, 1.0, 2.5, 6.0])
def test_errors_that_are_alike_in_all_rows_are_waves(rows: float) -> None:
    """As those of a section that is not exactly the beam's; a sensor's pattern repeats, too."""
    errors, narrower = [], []
    slope = rows / 455  # the image has 455 columns
    place = np.linspace(0, BEAM.length, 50)
    powers = np.column_stack([np.ones(50), place, *(place / BEAM.length) ** [[2], [3], [4]]])
    for draw in range(60):
        random = generator(__name__, draw)
        waves = 0.3 * SIGMA_PX * random.standard_normal(4)
        # Too small to be found.
        bow = 0.1 * SIGMA_PX * PIXEL / PARABOLA * random.standard_normal()
        images = lines(slope * X + bow * (X / BEAM.length) ** 2, random, camera=LEVEL)
        pattern = 0.5 * SIGMA_PX * random.standard_normal(len(images[0].points))
        wrong = []
        for line in images:
            points = line.points.copy()
            phase = 2 * np.pi * np.outer(points[:, 1], [1, 2])
            points[:, 1] += np.column_stack([np.sin(phase), np.cos(phase)]) @ waves + pattern
            wrong.append(down_columns(points, line.sigma))
        alike, other = (
            fit_rest_line(wrong, Calibration(LEVEL, 0.02), rig(), rows_alike=rows_alike)
            for rows_alike in (True, False)
        )
        off = powers @ [alike.y_at_clamp, alike.slope - slope, *alike.bow]
        off -= bow * (place / BEAM.length) ** 2
        variance = np.einsum("ni,ij,nj->n", powers, alike.covariance, powers)
        errors.append(np.mean(off**2) / np.mean(variance))
        narrower.append(alike.bow_size / other.bow_size)
    # 0.5 to 1.0, and a tenth to a half.
    assert 0.3 < np.sqrt(np.mean(errors)) < 1.4
    assert np.median(narrower) < 0.7


@pytest.mark.parametrize("length", [1, 12])
def test_errors_of_a_known_ground_do_not_follow_the_rows(length: int) -> None:
    """Errors that repeat because of the ground are independent, but for neighbours on one grain."""
    chi2, narrower = [], []
    for draw in range(60):
        random = generator(__name__, draw)
        images = lines(2e-5 + 1e-3 * X, random, camera=LEVEL)
        n = len(images[0].points)
        white = random.standard_normal(n + length - 1)
        ground = SIGMA_PX * np.convolve(white, np.full(length, length**-0.5), "valid")
        wrong = [
            replace(one, points=one.points + np.column_stack([np.zeros(n), ground]))
            for one in images
        ]
        # The mean of four images has a quarter of the variance of one.
        stated = GroundErrors(4.0, 4.0 * (length - 1))
        rest = fit_rest_line(wrong, Calibration(LEVEL, 0.02), rig(), stated)
        error = np.array([rest.y_at_clamp - 2e-5, rest.slope - 1e-3])
        chi2.append(error @ np.linalg.solve(rest.line_covariance, error))
        unstated = fit_rest_line(wrong, Calibration(LEVEL, 0.02), rig())
        narrower.append(rest.line_covariance[0, 0] / unstated.line_covariance[0, 0])
    assert 1.0 < np.mean(chi2) < 3.5  # two degrees of freedom: 2 +- 0.26
    assert np.median(narrower) < 0.5


@pytest.mark.parametrize("together", [False, True])
def test_a_bow_is_found_beside_an_object(together: bool) -> None:
    """The object moves a third of the points, each by itself or all to one side."""
    random = generator(__name__, 5)
    bow = 3e-4 * (X / BEAM.length) ** 2
    disturbed = []
    for line in lines(1e-3 * X + bow, random):
        points = line.points.copy()
        third = len(points) // 3
        each = generator(__name__, 6).normal(0, 0.12, third)
        points[third : 2 * third, 1] += 0.08 if together else each
        disturbed.append(down_columns(points, line.sigma))
    rest = fit_rest_line(disturbed, Calibration(CAMERA, 0.02), rig())
    assert rest.bow.any()
    found, _ = rest.bow_at(X)
    whole = rest.y_at_clamp + rest.slope * X + found
    assert np.abs(whole - 1e-3 * X - bow).max() < 1e-4


def drawn_to_rows(line: Centreline, share: float) -> Centreline:
    """The line as sharpening shows it: its centres are drawn towards the middles of their rows."""
    points = line.points.copy()
    points[:, 1] -= share / (2 * np.pi) * np.sin(2 * np.pi * points[:, 1])
    return down_columns(points, line.sigma)


@pytest.mark.parametrize("slope", [1.5e-3, 2e-3, 3e-3])
def test_a_bow_that_the_pixel_rows_may_imitate_is_left_open(
    slope: float, random: np.random.Generator
) -> None:
    shown = [drawn_to_rows(one, 0.9) for one in lines(slope * X, random, camera=LEVEL)]
    rest = fit_rest_line(shown, Calibration(LEVEL, 0.02), rig())
    assert rest.bow_undecided
    assert not rest.bow.any()
    _, sigma = rest.bow_at(X)
    # The standard deviation about zero of what is uniform up to the bow that the rows imitate.
    columns = shown[0].points[:, 0]
    imitated = np.polynomial.Polynomial.fit(columns, shown[0].points[:, 1], 4)(columns)
    imitated -= np.polynomial.Polynomial.fit(columns, imitated, 1)(columns)
    imitated = np.abs(imitated).max() * PIXEL
    assert 0.5 * imitated < np.sqrt(3) * sigma.max() < 2 * imitated


def test_a_bow_of_more_than_half_a_pixel_is_none_of_the_rows(random: np.random.Generator) -> None:
    bow = 4.8 * PIXEL * (X / BEAM.length) ** 2
    shown = [drawn_to_rows(one, 0.9) for one in lines(2e-3 * X + bow, random, camera=LEVEL)]
    rest = fit_rest_line(shown, Calibration(LEVEL, 0.02), rig())
    assert rest.bow.any()


def test_errors_that_alternate_from_column_to_column_hardly_widen_the_covariance() -> None:
    """As those of a demosaiced image of a beam that crosses many rows do."""

    def sigma(alternating: float) -> float:
        random = generator(__name__, 9)
        shown = []
        for line in lines(0.05 * X, random, camera=LEVEL):
            points = line.points.copy()
            points[::2, 1] += alternating
            points[1::2, 1] -= alternating
            shown.append(down_columns(points, line.sigma))
        rest = fit_rest_line(shown, Calibration(LEVEL, 0.02), rig())
        assert not rest.bow.any()
        return float(np.sqrt(rest.line_covariance[1, 1]))

    # As many independent errors of that size would do at most.
    columns = len(lines(0.05 * X, generator(__name__, 9), camera=LEVEL)[0].points)
    independent = 0.1 * PIXEL / BEAM.length * np.sqrt(12 / columns)
    assert sigma(0.1) < 2 * independent


@pytest.mark.thorough
@pytest.mark.parametrize(("stated", "least"), [(math.inf, 20), (2e-3 * PIXEL / BEAM.length, 0)])
def test_a_bow_within_the_noise_is_within_its_sigma(
    stated: float, least: int, random: np.random.Generator
) -> None:
    """Whether it is subtracted or not; its size is drawn as it is expected."""
    straight = replace(rig(), shape=replace(UNIFORM, bow_sigma=stated))
    errors = []
    place = np.linspace(0, BEAM.length, 50)
    shape = (place / BEAM.length) ** 2
    about_line = shape - np.polynomial.Polynomial.fit(place, shape, 1)(place)
    size = min(SMALL_BOW_PX * PIXEL / np.sqrt(np.mean(about_line**2)), stated * BEAM.length)
    subtracted = 0
    for _ in range(400):
        amplitude = size * random.standard_normal()
        bow = amplitude * (X / BEAM.length) ** 2
        rest = fit_rest_line(lines(0.02 * X + bow, random), Calibration(CAMERA, 0.02), straight)
        found, sigma = rest.bow_at(place)
        found = found - np.polynomial.Polynomial.fit(place, found, 1)(place)
        errors.append(np.mean((found - amplitude * about_line) ** 2) / np.mean(sigma**2))
        subtracted += bool(rest.bow.any())
    assert subtracted in range(least, 400)
    assert 0.6 < np.sqrt(np.mean(errors)) < 1.45


def test_what_the_rig_states_of_the_bow_holds_but_for_distortion(
    random: np.random.Generator,
) -> None:
    shown = lines(0.02 * X, random)
    straight = replace(rig(), shape=replace(UNIFORM, bow_sigma=0.0))
    unknown, certain, distorted = (
        fit_rest_line(shown, Calibration(CAMERA, 0.02), one).bow_size
        for one in (rig(), straight, replace(straight, distortion_coefficients=5))
    )
    assert certain < 0.05 * unknown
    assert distorted == pytest.approx(unknown)


def test_a_known_error_of_the_grid_is_no_bow(random: np.random.Generator) -> None:
    """The beam crosses less than a row: alone, the error cannot be distinguished from a bow."""
    covariance = 1e-3**2 * np.eye(4)
    known = GridError(True, np.array([[0.0, 0.5], [0.5, 0.5]]), np.array([0.05, 0.1, -0.08, 0.03]),
                      covariance)  # fmt: skip
    chi2, sizes = [], []
    for _ in range(20):
        # What a frame shows of the error is not exactly what it is.
        truth = known._replace(
            coefficients=random.multivariate_normal(known.coefficients, covariance)
        )
        images = []
        for line in lines(2e-5 + 1e-3 * X, random, camera=LEVEL):
            along, across = line.points.T
            moved = np.column_stack([along, across + truth.at(along, across)])
            images.append(replace(line, points=moved, sigma=np.full(len(along), 0.09)))
        calibration = Calibration(LEVEL, 0.02)
        corrected = [without_grid_error(line, known) for line in images]
        rest = fit_rest_line(corrected, calibration, rig())
        error = np.array([rest.y_at_clamp - 2e-5, rest.slope - 1e-3])
        chi2.append(error @ np.linalg.solve(rest.line_covariance, error) / 2)
        before = fit_rest_line(images, calibration, rig())
        sizes.append(before.line_covariance[0, 0] / rest.line_covariance[0, 0])
        assert without_grid_error(corrected[0], known) is corrected[0]
        # A beam at rest shows short waves only: the bent one shows them better, and others.
        own = GridError(True, np.array([[0.0, 4.0]]), np.array([0.02, -0.01]), 1e-6 * np.eye(2))
        along, across = images[0].points.T
        smooth = np.polynomial.Polynomial.fit(along, across, 4)(along)
        left = np.column_stack([along, across - own.at(along, smooth)])
        again = without_grid_error(replace(images[0], points=left, grid_error=own), known)
        assert again.grid_error is not None
        assert not (again.grid_error.frequencies == 4.0).any()
        assert np.abs(again.points - corrected[0].points).max() < 5e-3
    assert 0.2 < np.mean(chi2) < 2.0  # 1 +- 0.2 if the bow were not fitted, too
    assert np.median(sizes) > 25
