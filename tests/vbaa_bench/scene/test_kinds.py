"""Every value of a key that chooses a kind has its kind, in the order of messages."""

from collections.abc import Iterator, Mapping
from typing import Any, get_args

import pytest
from pydantic import BaseModel

from vbaa_bench.geometry.tip import TIPS
from vbaa_bench.scene.beam import SECTIONS, BeamSpec


def values(annotation: Any) -> Iterator[str]:
    """Yield the texts that a type allows."""
    for part in get_args(annotation):
        if isinstance(part, str):
            yield part
        yield from values(part)


@pytest.mark.parametrize(
    ("model", "key", "kinds"),
    [
        (BeamSpec, "tip", TIPS),
        (BeamSpec, "section", SECTIONS),
    ],
)
def test_every_value_has_its_kind(
    model: type[BaseModel], key: str, kinds: Mapping[str, object]
) -> None:
    assert list(values(model.model_fields[key].annotation)) == list(kinds)
