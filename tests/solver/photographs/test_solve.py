"""The joint fit of drawn sets: recovers the truth, is honest, and names what it cannot know."""

import math
from dataclasses import replace

import numpy as np
import pytest

from solver.instrument.beam_shape import BeamShape, stated_shape
from solver.instrument.estimate import Outcome
from solver.photographs.line import fitted_line
from solver.photographs.photo_set import PhotoLoad, PhotoSet, Stated
from solver.photographs.solve import PhotosAnswer, answer_photos
from solver.tracing.beam_fit import TracedBeam
from tests.draws import generator
from tests.photo_sets import (
    LENGTH,
    RIGIDITY,
    DrawnSet,
    Force,
    Noise,
    SetSpec,
    TrueBeam,
    TrueCamera,
    drawn_set,
    photograph,
)

QUIET = SetSpec(noise=Noise(0.02, 0.05), marks=4, known_places=False, spread=0.5)


def answered(drawn: DrawnSet) -> PhotosAnswer:
    return answer_photos(drawn.photos, list(drawn.shown), {})


def pulls(drawn: DrawnSet, answer: PhotosAnswer) -> list[float]:
    """Errors of places and forces in stated sigmas."""
    found = []
    for truth, one in zip(drawn.truth, answer.answers, strict=True):
        if truth.load:
            assert one.outcome.has_values, one
            pairs = [("s_c_m", truth.load.at), ("x_c_m", truth.contact[0])]
            pairs += [("y_c_m", truth.contact[1]), ("force_n", truth.load.size)]
            for name, value in pairs:
                estimate = one.values[name]
                found.append((estimate.value - value) / estimate.sigma)
    return found


@pytest.fixture(scope="module")
def quiet() -> tuple[DrawnSet, PhotosAnswer]:
    drawn = drawn_set(5, QUIET)
    return drawn, answered(drawn)


@pytest.mark.thorough
def test_photographs_with_little_noise_give_the_loads_and_ei(
    quiet: tuple[DrawnSet, PhotosAnswer],
) -> None:
    drawn, answer = quiet
    for truth, one in zip(drawn.truth, answer.answers, strict=True):
        if truth.load is None:
            assert one.outcome is Outcome.NO_CONTACT
            continue
        # What is left is the error of the known force and of the length.
        assert one.values["s_c_m"].value == pytest.approx(truth.load.at, rel=1e-3)
        assert one.values["force_n"].value == pytest.approx(truth.load.size, rel=4e-3)
    rigidity = answer.shared["flexural_rigidity_n_m2"]
    assert rigidity.value == pytest.approx(drawn.beam.rigidity, rel=4e-3)
    assert rigidity.sigma < 5e-3 * rigidity.value
    assert answer.shared["k1"].sigma < 1e-3
    assert np.abs(pulls(drawn, answer)).max() < 3.5


@pytest.mark.thorough
@pytest.mark.parametrize(
    "spec",
    [
        SetSpec(),
        SetSpec(kind="push", marks=4, known_forces=0, known_places=False),
    ],
)
def test_errors_are_within_the_stated_sigmas(spec: SetSpec) -> None:
    drawn = drawn_set(11, spec)
    every = pulls(drawn, answered(drawn))
    assert np.abs(every).max() < 4
    assert 0.3 < math.sqrt(np.mean(np.square(every))) < 1.7


@pytest.mark.thorough
def test_marks_determine_the_view_and_without_them_it_is_an_assumption() -> None:
    spec = SetSpec(known_places=False)
    without, marked = answered(drawn_set(21, spec)), answered(drawn_set(21, replace(spec, marks=6)))
    places = [[one.values["s_c_m"] for one in a.answers[2:]] for a in (without, marked)]
    for plain, better in zip(*places, strict=True):
        assert plain.sigma > 2 * better.sigma
        assert plain.view_share > better.view_share
    views = [a.answers[2].values["view_b_rad"].sigma for a in (without, marked)]
    assert views[1] < math.radians(0.2) < views[0]
    assert any("fewer than 4 marks" in note for note in without.notes)
    assert any("rotation of the beam in its clamp" in note for note in without.notes)
    assert not any("marks" in note for note in marked.notes)


@pytest.mark.thorough
def test_without_a_force_and_ei_only_ratios_follow() -> None:
    drawn = drawn_set(31, replace(QUIET, rest=1, loads=2, known_forces=0, rigidity_stated=False))
    answer = answered(drawn)
    assert "flexural_rigidity_n_m2" not in answer.shared
    loads = [
        (truth.load.size, one.values["force_over_rigidity_per_m2"])
        for truth, one in zip(drawn.truth, answer.answers, strict=True)
        if truth.load
    ]
    assert not any("force_n" in one.values for one in answer.answers)
    first, reference = loads[0]
    for size, ratio in loads[1:]:
        assert ratio.value / reference.value == pytest.approx(size / first, rel=3e-3)
    assert any("only force_over_rigidity_per_mm2 follows" in note for note in answer.notes)


@pytest.mark.thorough
def test_a_beam_with_two_loads_is_left_out_and_points_off_the_beam_are_rejected() -> None:
    drawn = drawn_set(41, SetSpec(marks=4))
    last, second = drawn.shown[-1].beam, drawn.shown[-2].beam
    along = np.linspace(0, 1, len(last.points))
    wavy = last.points + 12 * np.sin(3 * np.pi * along)[:, None] * last.normals
    stray = second.points.copy()
    stray[100:120] += 15 * second.normals[100:120]
    shown = list(drawn.shown)
    shown[-1] = shown[-1]._replace(beam=last._replace(points=wavy))
    shown[-2] = shown[-2]._replace(beam=second._replace(points=stray))
    answer = answer_photos(drawn.photos, [*shown], {})
    assert answer.answers[-1].outcome is Outcome.INVALID
    assert "no beam with a single load" in answer.answers[-1].message
    assert not answer.answers[-1].values
    rejected = answer.answers[-2].rejected
    assert rejected is not None
    assert 20 <= rejected <= 24
    # The other photographs are as accurate as they state.
    others = drawn._replace(truth=drawn.truth[:-1])
    assert np.abs(pulls(others, replace(answer, answers=answer.answers[:-1]))).max() < 4


def test_the_fitted_line_is_on_the_points() -> None:
    drawn = drawn_set(51, SetSpec(rest=1, loads=2, marks=6, known_forces=2))
    answer = answered(drawn)
    assert answer.fit
    for i, shown in enumerate(drawn.shown):
        line = fitted_line(answer.fit, i)
        points = shown.beam.points - (np.array(shown.size) - 1) / 2
        # Points are 10 px apart, and the tip and the clamp 30 px beyond them.
        distances = np.linalg.norm(line.pixels[:, None] - points, axis=2).min(axis=1)
        assert distances.max() < 50
        chord = np.array([line.pixels[0], line.pixels[-1]])
        inner = (np.linalg.norm(line.pixels[:, None] - chord, axis=2) > 100).all(axis=1)
        assert distances[inner].max() < 9
        assert (line.load is None) == (drawn.truth[i].load is None)


def test_a_wrong_force_is_named() -> None:
    drawn = drawn_set(51, SetSpec(marks=6, known_forces=3))
    photos = list(drawn.photos.photographs)
    load = photos[-1].load
    assert load
    assert load.force
    wrong = load.force._replace(value=1.2 * load.force.value)
    photos[-1] = replace(photos[-1], load=replace(load, force=wrong))
    answer = answer_photos(replace(drawn.photos, photographs=tuple(photos)), list(drawn.shown), {})
    assert "load." in answer.answers[-1].message
    assert "sigmas from what the photographs show" in answer.answers[-1].message
    assert answer.fitted == (0, 1, 2, 3)
    assert all(one.outcome.has_values for one in answer.answers[2:4])


@pytest.mark.thorough
def test_photographs_without_a_beam_have_an_outcome() -> None:
    drawn = drawn_set(61, SetSpec(rest=1, loads=1))
    shown = [None, None]
    answer = answer_photos(drawn.photos, list(shown), {0: "no beam is found", 1: "dark"})
    assert [one.outcome for one in answer.answers] == [Outcome.INVALID] * 2
    assert [one.message for one in answer.answers] == ["no beam is found", "dark"]
    # A beam at rest that is stated to have a load.
    points = drawn.shown[0].beam
    loaded = replace(drawn.photos.photographs[0], load=drawn.photos.photographs[1].load)
    photos = replace(drawn.photos, photographs=(drawn.photos.photographs[0], loaded))
    beam = TracedBeam(points.points, points.normals, points.sigmas, points.widths)
    both = [drawn.shown[0], drawn.shown[0]._replace(beam=beam)]
    answers = answer_photos(photos, list(both), {}).answers
    # A load without a bend needs a larger EI than the stated one.
    assert [one.outcome for one in answers] == [Outcome.INVALID] * 2
    assert not any(one.values for one in answers)
    assert all("sigmas" in one.message for one in answers)


@pytest.mark.thorough
def test_a_beam_that_only_sags_has_no_load() -> None:
    """Two photographs of a beam under its own weight, of each of which a load is stated."""
    sag, rng = 0.2, generator(__name__, 1)
    beam = TrueBeam(bow=(-2 * sag, 4 / 3 * sag, -sag / 3))
    taken = []
    for i in range(2):
        camera = TrueCamera(roll=0.1 * i, view=(0.05, -0.08), k1=0.01, aim=(0.5, -0.1))
        photo, shown, _ = photograph(beam, camera, None, 0.01 * i, rng, name=f"{i}.jpg")
        taken.append((replace(photo, load=PhotoLoad("weight")), shown))
    photos = PhotoSet(
        tuple(photo for photo, _ in taken),
        Stated(LENGTH, 1e-3 * LENGTH),
        Stated(RIGIDITY, 0.2 * RIGIDITY),
        BeamShape(),
    )
    answer = answer_photos(photos, [shown for _, shown in taken], {})
    assert [one.outcome for one in answer.answers] == [Outcome.NOT_IDENTIFIABLE] * 2
    assert all("own weight" in one.message for one in answer.answers)
    assert not any("force_n" in one.values for one in answer.answers)


@pytest.mark.thorough
def test_one_photograph_that_fits_nothing_leaves_the_others() -> None:
    drawn = drawn_set(11, SetSpec())
    # The clamp is marked at the beam's tip.
    photos = list(drawn.photos.photographs)
    photos[-1] = replace(photos[-1], clamp=photos[-1].tip, tip=photos[-1].clamp)
    answer = answered(drawn._replace(photos=replace(drawn.photos, photographs=tuple(photos))))
    assert not answer.answers[-1].outcome.has_values
    assert answer.fitted == (0, 1, 2, 3)
    assert all(one.outcome.has_values for one in answer.answers[2:4])


@pytest.mark.thorough
def test_a_tick_scales_a_photograph_whose_tip_is_hidden() -> None:
    drawn = drawn_set(71, replace(QUIET, marks=0, known_places=True))
    photos = []
    for photo, shown in zip(drawn.photos.photographs, drawn.shown, strict=True):
        # Points are at equal arc lengths, 1 to 99 % of the length.
        arcs = np.array([0.01, 0.99]) * LENGTH
        ticks = np.column_stack([shown.beam.points[[0, -1]], arcs, np.full(2, 4e-4)])
        photos.append(replace(photo, tip=shown.beam.points[-1], tip_hidden=True, ticks=ticks))
    hidden = answered(drawn._replace(photos=replace(drawn.photos, photographs=tuple(photos))))
    assert np.abs(pulls(drawn, hidden)).max() < 4


@pytest.mark.thorough
@pytest.mark.parametrize("ticked", [True, False])
def test_a_hidden_end_of_a_tapered_beam_is_not_taken_for_its_tip(ticked: bool) -> None:
    """The tip is 0.6 times as wide as the clamp; three fifths of the beam are visible."""
    random, beam, visible = generator(__name__, 41), TrueBeam(widths=(-0.4,)), 0.6
    photos, shown, truths = [], [], []
    for i in range(5):
        at = float(random.uniform(0.3, 0.5)) * LENGTH
        load = Force("push", 0.15 * RIGIDITY / LENGTH**2 * (LENGTH / at) ** 2, at) if i else None
        camera = TrueCamera(view=tuple(random.normal(0, math.radians(4), 2)))
        photo, seen, truth = photograph(
            beam, camera, load, 0.0, random, Noise(0.05, 0.2), 4, f"{i}.jpg"
        )
        count = round(visible * len(seen.beam.points))
        part = TracedBeam(
            seen.beam.points[:count],
            seen.beam.normals[:count],
            seen.beam.sigmas[:count],
            seen.beam.widths[:count],
        )
        # Points are at equal arc lengths, 1 to 99 % of the length.
        arcs = np.linspace(0.01, 0.99, len(seen.beam.points))[[0, count - 1]] * LENGTH
        ticks = np.column_stack([part.points[[0, -1]], arcs, np.full(2, 2e-4)])
        stated = None
        if load is not None:
            force = Stated(load.size, 2e-3 * load.size) if i == 1 else None
            stated = PhotoLoad("push", force, None)
        photo = replace(photo, tip=part.points[-1], tip_hidden=True, load=stated)
        photos.append(replace(photo, ticks=ticks) if ticked else photo)
        shown.append(seen._replace(beam=part))
        truths.append(truth)
    drawn = DrawnSet(
        PhotoSet(
            photographs=tuple(photos),
            length=Stated(LENGTH, 1e-3 * LENGTH),
            rigidity=Stated(RIGIDITY, 0.2 * RIGIDITY),
            shape=stated_shape(0.3, 0.0, 0.0, 0.0),
            focal=Stated(3000.0, 30.0),
            k1=Stated(0.0, 1e-3),
            mark_sigma=0.2,
        ),
        shown,
        truths,
        beam,
    )
    answer = answered(drawn)
    assert np.abs(pulls(drawn, answer)).max() < 4
    width = answer.shared["width_0"]
    assert abs(width.value + 0.4) < 4 * width.sigma


def test_a_load_may_be_stated_to_be_near_the_clamp() -> None:
    """A place of 0 mm, known to 80: a fit cannot start at the clamp."""
    drawn = drawn_set(5, QUIET)
    photos = list(drawn.photos.photographs)
    last = photos[-1].load
    assert last is not None
    photos[-1] = replace(photos[-1], load=replace(last, place=Stated(0.0, 0.5 * LENGTH)))
    answer = answered(drawn._replace(photos=replace(drawn.photos, photographs=tuple(photos))))
    assert answer.answers[-1].outcome is Outcome.CONTACT
    assert np.abs(pulls(drawn, answer)).max() < 4
