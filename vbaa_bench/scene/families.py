"""Families of kinds: the models that a section of a scene may have, named by its key `kind`.

Every kind is one module, which registers its model in its family. Kinds of the package and those of
a user's module register in the same way; the latter are allowed once the module is in use
(`vbaa_bench/scene/user_modules.py`).

Names of frames, seeds and the identity of a dataset are hashes of the values of a scene in the
order of the models' fields. The order of the fields of a kind is therefore part of the format: new
fields come last, and none is moved. A subclass that declares a field again leaves it in its place.
"""

import operator
from collections.abc import Mapping, Sequence
from functools import reduce
from typing import Annotated, Any, Final, Generic, TypeVar, get_args

from pydantic import BaseModel, Field, GetCoreSchemaHandler
from pydantic.fields import FieldInfo
from pydantic_core import CoreSchema

from solver.instrument.errors import InputError

_PACKAGE: Final = __name__.partition(".")[0]
# Names of users' modules whose kinds are allowed. Set by `use_module`.
MODULES_IN_USE: Final = set[str]()
# All families; those whose kinds have sections of other families come after these.
_FAMILIES: Final = list["Family[Any]"]()
K = TypeVar("K", bound=BaseModel)


class Family(Generic[K]):
    """Kinds of one base class, which the type `Annotated[Base, FAMILY]` allows.

    Pydantic compiles the allowed kinds into each model that has such a section: `rebuild` does it
    anew after a change.
    """

    def __init__(self) -> None:
        self._models: dict[str, type[K]] = {}
        _FAMILIES.append(self)

    def register(self, *models: type[K]) -> None:
        """Add kinds. Raises InputError for a model without `kind`, and for a name that is taken."""
        for model in models:
            name = kind_of(model)
            if name is None:
                raise InputError(f"{_name(model)}: has no key kind, allowed is a Literal text")
            other = self._models.get(name)
            # A module that is imported again defines its kinds anew.
            if other is not None and _is_allowed(other) and _name(other) != _name(model):
                raise InputError(f"{_name(model)}: kind {name} is that of {_name(other)}")
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


def rebuild(model: type[BaseModel]) -> None:
    """Compile the kinds that are allowed now into all kinds, and then into a model of them."""
    for kind in (kind for family in _FAMILIES for kind in family.models.values()):
        kind.model_rebuild(force=True)
    model.model_rebuild(force=True)


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


def narrowed(
    models: Sequence[type[BaseModel]], values: Mapping[str, Any]
) -> Sequence[type[BaseModel]]:
    """Return the model of the kind that a section states, or all where it states none of them."""
    stated = values.get("kind")
    return [model for model in models if kind_of(model) == stated] or models


def _is_allowed(model: type[BaseModel]) -> bool:
    module = model.__module__
    return module.partition(".")[0] == _PACKAGE or module in MODULES_IN_USE


def _name(model: type[BaseModel]) -> str:
    return f"{model.__module__}.{model.__qualname__}"
