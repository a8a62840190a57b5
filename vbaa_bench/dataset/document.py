"""Check of JSON documents against a model when they are read.

A document comes with a dataset, which may be of anyone: a key that is missing, or has a value of
another type, would be a traceback far from its cause.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from solver.instrument.errors import InputError, quoted, truncated
from vbaa_bench.dataset.table_schema import LARGEST

# A figure in any unit.
Figure = Annotated[float, Field(ge=-LARGEST, le=LARGEST)]
_Model = TypeVar("_Model", bound=BaseModel)


class Document(BaseModel):
    """Keys of a document that are read; it may have others."""

    model_config = ConfigDict(frozen=True, strict=True, extra="allow")


def check_document(path: Path, document: Mapping[str, Any], model: type[_Model]) -> _Model:
    """Check a document that was read from `path`; return it as its model.

    Raises InputError, which names the first key that is missing or wrong.
    """
    try:
        return model.model_validate(document)
    except ValidationError as error:
        raise InputError(mistake_sentence(path, error.errors()[0])) from error


def mistake_sentence(path: Path, mistake: Mapping[str, Any], *section: str) -> str:
    """Write one of pydantic's errors, in a section of a document, as a sentence."""
    name = truncated(".".join(map(str, (*section, *mistake["loc"]))))
    if mistake["type"] == "missing":
        return f"{path}: the key {name} is missing"
    value, reason = quoted(mistake["input"]), truncated(mistake["msg"])
    return f"{path}: {name} is {value}, which is not allowed ({reason})"
