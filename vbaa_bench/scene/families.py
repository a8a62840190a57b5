"""Families of kinds: the models that a section of a scene may have, named by its key `kind`.

Every kind is one module, which registers its model in its family. Kinds that have all keys in
common are names of one key: what each decides is registered under its name. Kinds of the package
and those of a user's module register in the same way; the latter are allowed once the module is in
use (`vbaa_bench/scene/user_modules.py`).

Names of frames, seeds and the identity of a dataset are hashes of the values of a scene in the
order of the models' fields. The order of the fields of a kind is therefore part of the format: new
fields come last, and none is moved. A subclass that declares a field again leaves it in its place.
"""

import operator
from collections.abc import Iterator, Mapping, Sequence
from functools import reduce
from typing import Annotated, Any, Final, Generic, Literal, TypeVar, get_args

from pydantic import BaseModel, Field, GetCoreSchemaHandler
from pydantic.fields import FieldInfo
from pydantic_core import CoreSchema

from solver.instrument.errors import InputError

_PACKAGE: Final = __name__.partition(".")[0]
# Names of users' modules whose kinds are allowed. Set by `use_module`.
MODULES_IN_USE: Final = set[str]()
K = TypeVar("K", bound=BaseModel)
V = TypeVar("V")


class Family(Generic[K]):
    """Kinds of one base class, which the type `Annotated[Base, FAMILY]` allows.

    Pydantic compiles the allowed kinds into each model that has such a section: `rebuild` does it
    anew after a change.
    """

    def __init__(self) -> None:
        self._models: dict[str, type[K]] = {}

    def register(self, *models: type[K]) -> None:
        """Add kinds. Raises InputError for a model without `kind`, and for a name that is taken."""
        for model in models:
            name = kind_of(model)
            if name is None:
                raise InputError(f"{_name(model)}: has no key kind, allowed is a Literal text")
            _check_free(name, model, self._models.get(name))
            self._models[name] = model

    @property
    def models(self) -> dict[str, type[K]]:
        """The allowed kinds by name: those of the package, and of users' modules in use."""
        return {name: model for name, model in self._models.items() if _is_allowed(model)}

    def __get_pydantic_core_schema__(
        self, _source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        union = reduce(operator.or_, self.models.values())
        return handler.generate_schema(Annotated[union, Field(discriminator="kind")])


class Names(Generic[V]):
    """Kinds by the names that a key may have, which the type `Annotated[str, NAMES]` allows.

    A kind is a class, whose keys are those that all have in common. `others` are names that the
    key may have and that choose no kind.
    """

    def __init__(self, *others: str) -> None:
        self._others = others
        self._kinds: dict[str, type[V]] = {}

    def register(self, **kinds: type[V]) -> None:
        """Add kinds by their names. Raises InputError for a name that is taken."""
        for name, kind in kinds.items():
            _check_free(name, kind, self._kinds.get(name))
            self._kinds[name] = kind

    def __getitem__(self, name: str) -> type[V]:
        return self.kinds[name]

    @property
    def kinds(self) -> dict[str, type[V]]:
        """The allowed kinds by name: those of the package, and of users' modules in use."""
        return {name: kind for name, kind in self._kinds.items() if _is_allowed(kind)}

    def __get_pydantic_core_schema__(
        self, _source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        return handler.generate_schema(Literal[(*self._others, *self.kinds)])


def rebuild(model: type[BaseModel]) -> None:
    """Compile the kinds that are allowed now into a model and all its sections."""
    for section in _inner_first(model, set()):
        section.model_rebuild(force=True)


def _inner_first(
    model: type[BaseModel], visited: set[type[BaseModel]]
) -> Iterator[type[BaseModel]]:
    visited.add(model)
    for field in model.model_fields.values():
        for section in sections(field):
            if section not in visited:
                yield from _inner_first(section, visited)
    yield model


def kind_of(model: type[BaseModel]) -> str | None:
    """Return the name of a kind, the only value that its key `kind` allows; None for others."""
    field = model.model_fields.get("kind")
    names = () if field is None else get_args(field.annotation)
    return names[0] if len(names) == 1 and isinstance(names[0], str) else None


def family_of(annotation: Any) -> Family[Any] | None:
    """Return the family that a field or a type allows; None if it is none, or more than one."""
    parts = annotation.metadata if isinstance(annotation, FieldInfo) else get_args(annotation)
    if (family := next((part for part in parts if isinstance(part, Family)), None)) is not None:
        return family
    if isinstance(annotation, FieldInfo):
        return family_of(annotation.annotation)
    families = [family for part in parts if (family := family_of(part)) is not None]
    return families[0] if len(families) == 1 else None


def sections(annotation: Any) -> list[type[BaseModel]]:
    """List the models that a field or a type allows."""
    if (family := family_of(annotation)) is not None:
        return list(family.models.values())
    if isinstance(annotation, FieldInfo):
        return sections(annotation.annotation)
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [model for option in get_args(annotation) for model in sections(option)]


def module_of(model: type[BaseModel], key: str, value: Any) -> str | None:
    """Return the module of the kind that a value of a key of a section chooses; None for others."""
    if key == "kind" and kind_of(model) == value:
        return model.__module__
    field = model.model_fields.get(key)
    kinds = {} if field is None or (names := names_of(field)) is None else names.kinds
    return kinds[value].__module__ if value in kinds else None


def names_of(field: FieldInfo) -> Names[Any] | None:
    """Return the kinds that a field chooses by a name; None if it is another."""
    return next((mark for mark in marks(field) if isinstance(mark, Names)), None)


def marks(field: FieldInfo) -> Iterator[Any]:
    """Yield the marks of the type of a field and of its parts, and the parts."""
    yield from field.metadata
    yield from _parts(field.annotation)


def _parts(annotation: Any) -> Iterator[Any]:
    for part in get_args(annotation):
        yield part
        yield from _parts(part)


def narrowed(
    models: Sequence[type[BaseModel]], values: Mapping[str, Any]
) -> Sequence[type[BaseModel]]:
    """Return the model of the kind that a section states, or all where it states none of them."""
    stated = values.get("kind")
    return [model for model in models if kind_of(model) == stated] or models


def _check_free(name: str, kind: type, other: type | None) -> None:
    # A module that is imported again defines its kinds anew.
    if other is not None and _is_allowed(other) and _name(other) != _name(kind):
        raise InputError(f"{_name(kind)}: kind {name} is that of {_name(other)}")


def _is_allowed(kind: type) -> bool:
    module = kind.__module__
    return module.partition(".")[0] == _PACKAGE or module in MODULES_IN_USE


def _name(kind: type) -> str:
    return f"{kind.__module__}.{kind.__qualname__}"
