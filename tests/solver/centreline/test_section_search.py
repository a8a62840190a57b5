"""The section of a beam that lies along one row of pixels, which shows its profile in part."""

from dataclasses import replace

import numpy as np
import pytest

from solver.centreline import appearance
from solver.centreline.rest_columns import RestColumns
from solver.centreline.section_search import find_sections
from tests.beam_images import Look, Sensor, bent, drawn, guide


def learned(
    tilt: float, random: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> tuple[RestColumns, appearance.Appearance]:
    """The columns at rest of a beam with a tilt [rad] against the rows, and its appearance."""
    look, seen = Look(radius_px=0.8, spread_px=0.1, roundness=1.0), list[RestColumns]()
    light = drawn(guide(), bent(0.0, tilt=tilt), look)

    def search(rest: RestColumns) -> object:
        seen.append(rest)
        return find_sections(rest)

    monkeypatch.setattr(appearance, "find_sections", search)
    rigs = replace(guide(), radius=look.radius_px * guide().pixel)
    found, _ = appearance.learn_appearance([Sensor()(light, random) for _ in range(4)], rigs)
    return seen[-1], found


def test_sections_that_explain_a_profile_in_part_alike_are_the_error_of_all_centres(
    random: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    rest, found = learned(1e-3, random, monkeypatch)
    assert found.in_part
    sections = find_sections(rest)
    first, *others = [rest.shape(section, rest.table(section)) for section in sections]
    assert found.section == first.section
    # None where one section is better than all others; that is so in two of eight seeds.
    apart = [np.median(np.abs(first.centre - other.centre)[first.good]) for other in others]
    assert found.sigma_px >= max(apart, default=0.0)


def test_a_profile_between_all_places_of_the_pixels_has_one_section(
    random: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    rest, found = learned(0.05, random, monkeypatch)
    assert not found.in_part
    assert len(find_sections(rest)) == 1
