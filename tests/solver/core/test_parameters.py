"""Parameters by name."""

import pytest

from solver.core.parameters import Parameters

AT = Parameters((("q", 1), ("widths", 2), ("bow", 0))).followed_by(("psi", 1))


def test_each_name_has_its_place() -> None:
    assert len(AT) == 4
    assert (AT["q"], AT["widths"], AT["psi"]) == (0, 1, 3)
    assert AT.span("widths") == slice(1, 3)
    assert AT.span("bow") == slice(3, 3)
    assert AT.indices("psi", "widths", "bow") == [3, 1, 2]
    assert "psi" in AT
    assert "tilt" not in AT


def test_an_unknown_name_is_an_error() -> None:
    with pytest.raises(KeyError, match="tilt"):
        AT["tilt"]


def test_a_name_that_is_taken_is_an_error() -> None:
    with pytest.raises(ValueError, match="repeated"):
        AT.followed_by(("psi", 1))
