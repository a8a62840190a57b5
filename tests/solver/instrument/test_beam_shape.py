import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import halfnorm

from solver.instrument.beam_shape import UNIFORM, BeamShape, stated_shape
from solver.instrument.errors import InputError
from solver.instrument.rig_json import read_rig, rig_to_json
from tests.simulated import rig

LEARNED = BeamShape(
    widths=np.array([-0.03, 0.01]),
    softness=0.002,
    clamp_shift=-0.003,
    skew=0.1,
    bow=np.array([1e-3, -2e-3, 5e-4]),
    covariance=np.diag([1e-4, 1e-3, 2e-3, 1e-2, 1e-4, 1e-4, 1e-4, 1e-4]) ** 2,
    section_sigma=0.02,
    rigidity_sigma=0.01,
    friction_sigma=0.2,
)
RIGID = stated_shape(0.02, 0.0, 0.01, 0.2, rigid_objects=True)
ROUGH = replace(RIGID, friction_coefficient=0.3, bow_sigma=1e-4)


@pytest.mark.parametrize(
    "shape",
    [
        UNIFORM,
        stated_shape(0.02, 0.0, 0.01, 0.2),
        stated_shape(0.0, 0.0, 0.0, 0.0, 0.002),
        LEARNED,
        RIGID,
        ROUGH,
        replace(LEARNED, rigid_objects=True, friction_coefficient=0.3, bow_sigma=1e-4),
    ],
)
def test_round_trip(shape: BeamShape, tmp_path: Path) -> None:
    path = tmp_path / "rig.json"
    path.write_text(rig_to_json(replace(rig(), shape=shape)))
    again = read_rig(path)
    assert rig_to_json(again) == path.read_text()
    assert again.shape.uniform is shape.uniform
    assert again.shape.rigid_objects is shape.rigid_objects
    assert again.shape.friction_coefficient == shape.friction_coefficient
    assert again.shape.bow_sigma == pytest.approx(shape.bow_sigma)
    assert again.shape.covariance == pytest.approx(shape.covariance, rel=1e-11)
    assert again.shape.rigidity_sigma == pytest.approx(shape.rigidity_sigma, rel=1e-11)


@pytest.mark.parametrize(
    ("key", "value", "allowed"),
    [
        ("widths", [0.1] * 9, "a list of at most 6 numbers from -10 to 10"),
        ("covariance", [[1.0]], "a list of 8 lists of 8 numbers"),
        ("covariance", np.eye(8)[::-1].tolist(), "without negative eigenvalues"),
        ("bow", [1e-3], "a list of none or 3 numbers"),
        ("friction_sigma", -1, "a number from 0 to 10"),
        ("rigid_objects", 1, "true or false"),
        ("bow_sigma_mm", 300, "a number from 0 to 240"),
    ],
)
def test_mistakes_name_file_key_and_what_is_allowed(
    key: str, value: object, allowed: str, tmp_path: Path
) -> None:
    path = tmp_path / "rig.json"
    document = json.loads(rig_to_json(replace(rig(), shape=LEARNED)))
    document["beam_shape"][key] = value
    path.write_text(json.dumps(document))
    with pytest.raises(InputError, match=allowed) as error:
        read_rig(path)
    assert f"{path}: beam_shape.{key}" in str(error.value)


def test_a_width_that_vanishes_along_the_beam_is_refused(tmp_path: Path) -> None:
    shape = replace(UNIFORM, widths=np.array([-1.5]), covariance=np.zeros((4, 4)))
    path = tmp_path / "rig.json"
    path.write_text(rig_to_json(replace(rig(), shape=shape)))
    with pytest.raises(InputError, match=r"rig.json: beam_shape.widths is \[-1.5\], allowed is"):
        read_rig(path)


def test_a_misspelt_key_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "rig.json"
    document = json.loads(rig_to_json(replace(rig(), shape=stated_shape(0.02, 0.0, 0.0, 0.0))))
    document["beam_shape"]["tapper_sigma"] = 0.1
    path.write_text(json.dumps(document))
    with pytest.raises(InputError, match=r"beam_shape\.tapper_sigma is unknown"):
        read_rig(path)


def test_a_beam_of_which_nothing_is_stated_is_drawn_wire(tmp_path: Path) -> None:
    path = tmp_path / "rig.json"
    document = json.loads(rig_to_json(rig()))
    del document["beam_shape"]
    path.write_text(json.dumps(document))
    wire = stated_shape(0.02, 0.002, 0.02, 0.2)
    assert rig_to_json(read_rig(path)) == rig_to_json(replace(rig(), shape=wire))
    document["beam_shape"] = {"rigidity_sigma": 0.0, "friction_sigma": 0.0}
    path.write_text(json.dumps(document))
    shape = read_rig(path).shape
    assert (shape.rigidity_sigma, shape.friction_sigma, shape.section_sigma) == (0.0, 0.0, 0.02)


def test_a_coefficient_is_the_half_of_the_normal_distribution_of_a_ratio() -> None:
    ratios = halfnorm(scale=0.2)
    assert RIGID.friction == pytest.approx((ratios.mean(), ratios.std()), rel=1e-9)
    assert ROUGH.friction == (0.3, 0.2)


def test_the_shape_is_checked() -> None:
    with pytest.raises(ValueError, match="the bow has 2 coefficients"):
        BeamShape(bow=np.zeros(2), covariance=np.zeros((5, 5)))
    with pytest.raises(ValueError, match="friction_sigma is -1"):
        BeamShape(friction_sigma=-1.0)
    with pytest.raises(ValueError, match="bow_sigma is nan"):
        BeamShape(bow_sigma=float("nan"))
    with pytest.raises(ValueError, match="covariance"):
        BeamShape(widths=np.zeros(1))
