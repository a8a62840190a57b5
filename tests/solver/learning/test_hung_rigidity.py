"""EI from a hung weight: the shape by three roads, then what noise and nuisances leave of EI."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline
from scipy.stats import chi2

from solver.instrument.arrays import Floats
from solver.instrument.beam_shape import (
    FRICTION_SIGMA,
    SECTION_SIGMA,
    SOFTNESS_SIGMA,
    TAPER_SIGMA,
    UNIFORM,
    BeamShape,
    stated_shape,
)
from solver.instrument.errors import InputError
from solver.instrument.measurement import Measurement
from solver.learning.hung_rigidity import HungWeight, flexural_rigidity, hung_beam
from tests.consistency import MOST_SIGMAS
from tests.oracle import oracle
from tests.simulated import BEAM, measurement
from vbaa_bench.mechanics.hung import hang
from vbaa_bench.mechanics.pushing import rest
from vbaa_bench.mechanics.rod import Rod
from vbaa_bench.mechanics.rod_contact import Motor

LENGTH, EI = BEAM.length, BEAM.flexural_rigidity
STEEL = 7850 * 9.807 * math.pi * (BEAM.diameter / 2) ** 2  # a metre's weight [N/m]
SIGMA = 2.5e-5  # 0.05 px of half a millimetre
AT = 0.2
WEIGHT = HungWeight(
    force=5e-3 * 9.807, force_sigma=0.0, at=AT, at_sigma=0.5e-3, level_sigma=math.radians(0.5)
)


@pytest.mark.parametrize("row", oracle()["classical_cantilever"][:4], ids=lambda row: row["alpha"])
def test_a_weight_bends_the_beam_as_bisshopp_and_drucker_say(row: dict[str, str]) -> None:
    bent = hung_beam(float(row["alpha"]) / AT**2, 0.0, AT, 0.0, LENGTH)
    assert bent is not None
    x = AT * (1 - float(row["u_over_L"]))
    assert float(bent(x)) == pytest.approx(AT * float(row["w_over_L"]), abs=1e-7 * LENGTH)
    slope = math.tan(float(row["theta0_rad"]))
    assert float(bent(x, 1)) == pytest.approx(slope, abs=1e-6)
    # Nothing hangs beyond it, where the beam is straight.
    assert float(bent(bent.x[-1], 1)) == pytest.approx(slope, abs=1e-6)


def test_the_beam_sags_as_the_rod_in_space_does() -> None:
    sag = hung_beam(0.0, STEEL / EI, AT, 0.0, LENGTH)
    assert sag is not None
    rod = rest(Rod(BEAM, weight=(0.0, STEEL, 0.0)), 480).centreline
    assert np.abs(sag(rod[:, 1]) - rod[:, 2]).max() < 1e-7 * LENGTH
    assert rod[-1, 2] > 3.9e-3


def test_a_clamp_that_points_down_is_bent_less_across_itself() -> None:
    level, down = (hung_beam(12.0, 0.0, AT, angle, LENGTH) for angle in (0.0, 0.1))
    assert level is not None
    assert down is not None
    # To first order in the load only the weight's component across the clamp bends.
    slight = [hung_beam(1e-3, 0.0, AT, angle, LENGTH) for angle in (0.0, 0.1)]
    assert slight[0] is not None
    assert slight[1] is not None
    assert float(slight[1](AT) / slight[0](AT)) == pytest.approx(math.cos(0.1), rel=1e-4)
    assert float(down(AT)) < float(level(AT)) * math.cos(0.1)  # the axial part pulls it straight


@pytest.mark.parametrize(("taper", "softness"), [(-0.2, 0.0), (0.1, 0.05)])
def test_a_tapered_beam_on_a_clamp_that_gives_hangs_as_the_rod_in_space(
    taper: float, softness: float
) -> None:
    rod = Rod(BEAM, tip_ratio=1 + taper, clamp_softness=softness, weight=(0.0, STEEL, 0.0))
    for force in (0.0, WEIGHT.force):
        bent = hung_beam(force / EI, STEEL / EI, AT, 0.0, LENGTH, (taper,), softness)
        assert bent is not None
        assert np.abs(bent(hung(rod, force)[:, 1]) - hung(rod, force)[:, 2]).max() < 1e-7 * LENGTH


@pytest.mark.parametrize("taper", [-0.02, 0.02])
def test_a_slight_taper_shifts_the_deflection_under_the_weight(taper: float) -> None:
    """By the taper times s_w / L: -4 c int (a - s)^2 s / L ds / int (a - s)^2 ds, from 0 to a."""
    shapes = (hung_beam(1.0, 0.0, AT, 0.0, LENGTH, widths) for widths in ((taper,), ()))
    cone, uniform = (float(shape(AT)) for shape in shapes if shape is not None)
    share = taper * AT / LENGTH
    assert cone / uniform == pytest.approx(1 - share + share**2, abs=5e-5)


def hung(rod: Rod, force: float, at: float = AT, level: float = 0.0) -> Floats:
    """The world's centreline (n, 4) under a weight, of a clamp that points down by `level`."""
    if not force:
        return rest(rod, 2000).centreline
    pull = force * np.array([math.sin(level), math.cos(level), 0.0])
    return hang(rod, Motor(), at, pull, [0.0], 2000)[0].centreline


def seen(
    shape: CubicHermiteSpline | None, random: np.random.Generator, y: float, tilt: float
) -> Measurement:
    """Image columns of a shape whose clamp is off by `y` [m] and `tilt` [rad]."""
    assert shape is not None
    x = np.arange(3e-3, shape.x[-1], 0.51e-3)
    turn = np.array([[math.cos(tilt), -math.sin(tilt)], [math.sin(tilt), math.cos(tilt)]])
    points = np.column_stack([x, shape(x)]) @ turn.T + [0.0, y]
    points[:, 1] += SIGMA * random.standard_normal(len(x))
    return measurement(points, SIGMA)


@pytest.mark.thorough
@pytest.mark.false_alarm(1e-7, "chi-square of 8 degrees of freedom, both sides")
def test_ei_is_found_within_its_sigma_whatever_the_rig_says(random: np.random.Generator) -> None:
    errors = []
    for trial in range(8):
        true = EI * (0.9, 1.07)[trial % 2]
        at = AT + WEIGHT.at_sigma * random.standard_normal()
        level = WEIGHT.level_sigma * random.standard_normal()
        side = (1, -1)[trial // 2 % 2]
        shapes = (
            hung_beam(side * load, side * STEEL / true, at, side * level, LENGTH)
            for load in (0.0, WEIGHT.force / true)
        )
        at_rest, loaded = (seen(shape, random, 1e-4, -0.02) for shape in shapes)
        found = flexural_rigidity([at_rest], [loaded], WEIGHT)
        assert found.sigma < 0.003 * true
        assert found.misfit == pytest.approx(1.0, abs=0.2)
        assert abs(found.sag) == pytest.approx(4.0e-3 * EI / true, rel=0.1)
        errors.append((found.value - true) / found.sigma)
    low, high = chi2.ppf([5e-8, 1 - 5e-8], len(errors))
    assert low < np.sum(np.square(errors)) < high


def test_a_weight_that_tells_nothing_is_refused(random: np.random.Generator) -> None:
    still = hung_beam(0.0, 0.0, AT, 0.0, LENGTH)
    hardly = hung_beam(1e-3, 0.0, AT, 0.0, LENGTH)
    at_rest = seen(still, random, 0.0, 0.0)
    with pytest.raises(InputError, match="too little to determine EI"):
        flexural_rigidity([at_rest], [seen(hardly, random, 0.0, 0.0)], WEIGHT)
    few = measurement(at_rest.points[:5], SIGMA)
    with pytest.raises(InputError, match="under the weight show 5 points, needed are 20"):
        flexural_rigidity([at_rest], [few], WEIGHT)
    beyond = HungWeight(0.05, 0.0, 0.25, 0.0, 0.0)
    with pytest.raises(InputError, match=r"hangs at 250 mm, .* below 240 mm"):
        flexural_rigidity([at_rest], [at_rest], beyond)


def bent(at: float, random: np.random.Generator) -> tuple[Measurement, ...]:
    """A steel beam at rest and under the weight at arc length `at`."""
    shapes = (hung_beam(load, STEEL / EI, at, 0.0, LENGTH) for load in (0.0, WEIGHT.force / EI))
    at_rest, loaded = (seen(shape, random, 0.0, 0.0) for shape in shapes)
    return at_rest, loaded


@pytest.mark.thorough
@pytest.mark.parametrize(("off", "towards"), [(0.01, "tip"), (-0.01, "clamp")])
def test_a_weight_that_hangs_elsewhere_is_refused(
    off: float, towards: str, random: np.random.Generator
) -> None:
    at_rest, loaded = bent(AT + off, random)
    with pytest.raises(InputError, match=rf"mm nearer to the {towards} than .*\d\d sigma"):
        flexural_rigidity([at_rest], [loaded], WEIGHT)


@pytest.mark.thorough
def test_a_clamp_that_is_not_level_is_refused(random: np.random.Generator) -> None:
    # So heavy a weight turns the tip by half a radian and tells which way is down.
    heavy = replace(WEIGHT, force=3 * WEIGHT.force, at_sigma=0.1e-3)
    shapes = (hung_beam(load, STEEL / EI, AT, 0.2, LENGTH) for load in (0.0, heavy.force / EI))
    at_rest, loaded = (seen(shape, random, 0.0, 0.0) for shape in shapes)
    with pytest.raises(InputError, match=r"fitted clamp is \d+(\.\d)? deg from level"):
        flexural_rigidity([at_rest], [loaded], heavy)


def test_a_shape_that_no_weight_makes_is_refused(random: np.random.Generator) -> None:
    at_rest, loaded = bent(AT, random)
    x = loaded.points[:, 0]
    wavy = loaded.points + np.column_stack([0 * x, 3e-4 * np.sin(60 * x)])
    with pytest.raises(InputError, match=r"points deviate by \d+\.\d sigma from the fitted"):
        flexural_rigidity([at_rest], [measurement(wavy, SIGMA)], WEIGHT)


def test_a_tenth_of_stray_points_is_not_followed(random: np.random.Generator) -> None:
    at_rest, loaded = bent(AT, random)
    points = loaded.points.copy()
    points[random.permutation(len(points))[: len(points) // 10], 1] += 40 * SIGMA
    found = flexural_rigidity([at_rest], [measurement(points, SIGMA)], WEIGHT)
    assert abs(found.value - EI) < MOST_SIGMAS * found.sigma
    assert found.sigma < 0.005 * EI


@pytest.mark.parametrize("factor", [30.0, pytest.param(1 / 30, marks=pytest.mark.thorough)])
def test_a_rig_that_is_30_times_off_does_not_matter(
    factor: float, random: np.random.Generator
) -> None:
    """Rig and images of a beam `factor` times as stiff, under a weight that bends it as usual."""
    heavy = replace(WEIGHT, force=factor * WEIGHT.force)
    shapes = (
        hung_beam(load, STEEL / EI / 30, AT, 0.0, LENGTH) for load in (0.0, WEIGHT.force / EI)
    )
    at_rest, loaded = (seen(shape, random, 0.0, 0.0) for shape in shapes)
    found = flexural_rigidity([at_rest], [loaded], heavy)
    assert abs(found.value - factor * EI) < MOST_SIGMAS * found.sigma
    assert found.sigma < 0.01 * factor * EI


@pytest.mark.thorough
@pytest.mark.parametrize(("stated", "sigma"), [(0.2399, 0.1), (0.22, 0.02)])
def test_a_weight_whose_place_is_hardly_known_may_hang_at_the_tip(
    stated: float, sigma: float, random: np.random.Generator
) -> None:
    at_rest, loaded = bent(0.235, random)
    vague = replace(WEIGHT, at=stated, at_sigma=sigma)
    found = flexural_rigidity([at_rest], [loaded], vague)
    assert abs(found.value - EI) < MOST_SIGMAS * found.sigma
    assert abs(found.at - 0.235) < MOST_SIGMAS * found.at_sigma
    assert found.at < LENGTH


@pytest.mark.parametrize("force", [0.0, math.inf, math.nan])
def test_a_weight_that_is_none_is_refused(force: float, random: np.random.Generator) -> None:
    at_rest, loaded = bent(AT, random)
    with pytest.raises(InputError, match="allowed is a finite number above 0"):
        flexural_rigidity([at_rest], [loaded], replace(WEIGHT, force=force))


DRAWN_WIRE = stated_shape(TAPER_SIGMA, SOFTNESS_SIGMA, SECTION_SIGMA, FRICTION_SIGMA)


def on_plane_c(line: Floats, random: np.random.Generator, shape: BeamShape) -> Measurement:
    """Columns of a line (n, 4) in space, as a camera above the beam's middle shows it."""
    viewpoint = np.array([LENGTH / 2, 0.0, 0.36, 1.0])
    lift = viewpoint[2] / (viewpoint[2] - line[:, 3:])
    points = viewpoint[:2] + (line[:, 1:3] - viewpoint[:2]) * lift
    x = np.arange(3e-3, points[-1, 0], 0.51e-3)
    y = np.interp(x, *points.T) + SIGMA * random.standard_normal(len(x))
    taken = measurement(np.column_stack([x, y]), SIGMA, base_sigma=1e-4)
    view = replace(taken.view, viewpoint=viewpoint)
    return replace(taken, view=view, rig=replace(taken.rig, shape=shape))


@pytest.mark.thorough
@pytest.mark.false_alarm(1e-5, "chi-square, five in a million outside either bound")
def test_errors_over_the_stated_tolerances_are_as_large_as_the_sigma(
    random: np.random.Generator,
) -> None:
    """The plane's EI: of a section with the axes 1 and 1 + e, at an angle a to the weight."""
    pulls, stated = [], replace(WEIGHT, force_sigma=0.0025 * WEIGHT.force)
    for _ in range(2):
        e, angle = SECTION_SIGMA * random.standard_normal(), random.uniform(0, math.pi)
        level = WEIGHT.level_sigma * random.standard_normal()
        rod = Rod(
            BEAM,
            tip_ratio=1 + TAPER_SIGMA * random.standard_normal(),
            clamp_softness=SOFTNESS_SIGMA * abs(random.standard_normal()),
            aspect_ratio=1 + e,
            section_angle=angle,
            weight=(STEEL * math.sin(level), STEEL * math.cos(level), 0.0),
        )
        true = EI / (math.cos(angle) ** 2 + math.sin(angle) ** 2 / (1 + e) ** 2)
        at = AT + WEIGHT.at_sigma * random.standard_normal()
        force = stated.force + stated.force_sigma * random.standard_normal()
        at_rest, loaded = (
            on_plane_c(hung(rod, weight, at, level), random, DRAWN_WIRE) for weight in (0.0, force)
        )
        found = flexural_rigidity([at_rest], [loaded], stated)
        pulls.append((found.value - true) / found.sigma)
        assert 0.002 * EI < found.known_shape_sigma < found.sigma < 0.008 * EI
    low, high = chi2.ppf([5e-6, 1 - 5e-6], len(pulls))
    assert low < np.sum(np.square(pulls)) < high


@pytest.mark.thorough
@pytest.mark.parametrize("taper", [-0.04, 0.04])
def test_ei_is_that_at_the_clamp_of_a_beam_that_may_be_tapered(
    taper: float, random: np.random.Generator
) -> None:
    rod = Rod(BEAM, tip_ratio=1 + taper, weight=(0.0, STEEL, 0.0))
    lines = [hung(rod, force) for force in (0.0, WEIGHT.force)]
    uniform, wire = (
        [on_plane_c(line, random, shape) for line in lines] for shape in (UNIFORM, DRAWN_WIRE)
    )
    found = flexural_rigidity(wire[:1], wire[1:], WEIGHT)
    # Five sigmas of noise, and the prior's pull towards a uniform beam: two sigmas of the taper.
    assert abs(found.value - EI) < 7 * found.sigma < 0.04 * EI
    # A taper that the rig excludes is mistaken for a weight at another place.
    with pytest.raises(InputError, match="nearer to the"):
        flexural_rigidity(uniform[:1], uniform[1:], WEIGHT)


@pytest.mark.thorough
def test_a_beam_that_is_not_the_stated_one_is_refused(random: np.random.Generator) -> None:
    rod = Rod(BEAM, tip_ratio=0.6, weight=(0.0, STEEL, 0.0))
    at_rest, loaded = (
        on_plane_c(hung(rod, force), random, stated_shape(0.02, 0.0, 0.0, 0.0))
        for force in (0.0, WEIGHT.force)
    )
    with pytest.raises(InputError, match=r"beam or its clamp is \d+ sigmas from what rig.json"):
        flexural_rigidity([at_rest], [loaded], replace(WEIGHT, at_sigma=5e-3))


def test_a_strip_that_bends_in_another_plane_is_refused(random: np.random.Generator) -> None:
    at_rest, loaded = (
        replace(frame, rig=replace(frame.rig, known_psi=0.5)) for frame in bent(AT, random)
    )
    with pytest.raises(InputError, match=r"beam\.known_psi_deg states another"):
        flexural_rigidity([at_rest], [loaded], WEIGHT)
