"""Every value of a key that chooses a kind has its kind, in the order of messages."""

from collections.abc import Iterator, Mapping
from typing import Any, get_args

import pytest
from pydantic import BaseModel

from vbaa_bench.geometry.tip import TIPS
from vbaa_bench.scene.background import GROUNDS, BackgroundSpec
from vbaa_bench.scene.beam import SECTIONS, BeamSpec
from vbaa_bench.scene.occlusion import OCCLUDERS, REMOVED, OcclusionSpec
from vbaa_bench.scene.paint import FINISHES, PaintedPart


def values(annotation: Any) -> Iterator[str]:
    """Yield the texts that a type allows."""
    for part in get_args(annotation):
        if isinstance(part, str):
            yield part
        yield from values(part)


@pytest.mark.parametrize(
    ("model", "key", "kinds"),
    [
        (PaintedPart, "paint", FINISHES),
        (BackgroundSpec, "pattern", GROUNDS),
        (OcclusionSpec, "kind", {REMOVED: None} | dict(OCCLUDERS)),
        (BeamSpec, "tip", TIPS),
        (BeamSpec, "section", SECTIONS),
    ],
)
def test_every_value_has_its_kind(
    model: type[BaseModel], key: str, kinds: Mapping[str, object]
) -> None:
    assert list(values(model.model_fields[key].annotation)) == list(kinds)
