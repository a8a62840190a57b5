"""Keys of a JSON document: a section that is none, and a key that is given twice."""

from pathlib import Path
from typing import Any

import pytest

from solver.instrument.errors import InputError
from solver.instrument.keys import Keys


@pytest.mark.parametrize("value", [[1], None, True, "lamp", 3])
def test_a_section_that_is_none_is_refused(value: Any) -> None:
    keys = Keys(Path("rig.json"), {"light": value, "list": [{"a": 1}, 5]})
    with pytest.raises(InputError, match=r"rig.json: light is .*, allowed is a section"):
        keys.has("light.slope")
    assert keys.number("list.0.a", 0, 2) == 1
    assert not keys.has("list.7.a")
    assert not keys.has("camera.bits")
    with pytest.raises(InputError, match=r"list.1 is 5, allowed is a section"):
        keys.has("list.1.a")


def test_a_document_that_is_no_section_has_no_keys() -> None:
    assert not Keys(Path("rig.json"), []).has("camera.bits")


def test_a_key_that_is_given_twice_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "rig.json"
    path.write_text('{"beam": {"length_mm": 1, "length_mm": 2}}')
    with pytest.raises(InputError, match="the key length_mm is given twice"):
        Keys.read(path)


@pytest.mark.parametrize(
    ("document", "sentence"),
    [
        ({"board": {"colums": 9}}, "the key board.columns is missing, and board.colums is unknown"),
        ({"bord": {"columns": 9}}, "the key board.columns is missing, and bord is unknown"),
        ({"board": {"rows": 9, "columns_mm": 3}}, "the key board.columns is missing"),
        ({}, "the key board.columns is missing"),
        ([], "the key board.columns is missing"),
    ],
)
def test_the_misspelt_form_of_a_missing_key_is_named(document: Any, sentence: str) -> None:
    with pytest.raises(InputError) as refused:
        Keys(Path("rig.json"), document).count("board.columns", 3, 20)
    assert str(refused.value) == f"rig.json: {sentence}"


def test_a_misspelt_key_of_an_item_is_named() -> None:
    keys = Keys(Path("photos.json"), {"photos": [{}, {"fil": "a.png"}]})
    with pytest.raises(InputError, match=r"photos\.1\.file is missing, and photos\.1\.fil is unk"):
        keys.file_name("photos.1.file")
