"""Commands whose help and refusals are in words, not as `<list[str]>` and `[default: ...]`."""

from pathlib import Path
from typing import Any, Final

import typer.core

from solver.instrument.errors import InputError

# A flag has no value. Types that are not here, such as one of several names, are words already.
_TYPES: Final[dict[Any, str]] = {
    bool: "",
    str: "TEXT",
    list[str]: "TEXT",
    Path: "PATH",
    list[Path]: "PATH",
    int: "NUMBER",
    float: "NUMBER",
}


class Command(typer.core.TyperCommand):
    """A command with such a help."""

    def get_params(self, ctx: Any) -> list[Any]:
        """Return arguments and options, with types and defaults in words."""
        return [in_words(parameter) for parameter in super().get_params(ctx)]

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse the words of a command line. Raises InputError for a rig that is an argument."""
        kinds = {one.name: one.param_type_name for one in self.get_params(ctx)}
        takes_rig_only = "rig" in kinds and "argument" not in kinds.values()
        ctx.allow_extra_args = ctx.allow_extra_args or takes_rig_only
        others = super().parse_args(ctx, args)
        if takes_rig_only and others:
            raise InputError(
                f"{ctx.info_name} has no argument '{others[0]}'; give the rig by --rig {others[0]}"
            )
        return others


class Group(typer.core.TyperGroup):
    """Commands whose own options have such a help."""

    def get_params(self, ctx: Any) -> list[Any]:
        """Return the options, with types in words."""
        return [in_words(parameter) for parameter in super().get_params(ctx)]


def in_words(parameter: Any) -> Any:
    """Let a parameter of a command say its type and its default in words; return it."""
    words = _TYPES.get(parameter.type_descriptor.annotation)
    if parameter.param_type_name == "argument":
        if words is not None:
            # The metavar of an argument is its name.
            parameter.display_type_rich = lambda **_: words
    elif parameter.metavar is None:
        parameter.metavar = words
    if parameter.show_default is not False:
        if default := _default(parameter):
            parameter.help = f"{parameter.help}; default: {default}"
        parameter.show_default = False
    return parameter


def _default(parameter: Any) -> str:
    """Return the default of a parameter in words, "" if it has none."""
    if isinstance(parameter.show_default, str):
        return parameter.show_default
    match parameter.default:
        case None | False:
            return ""
        case True:
            return "yes"
        case float(number):
            return f"{number:g}"
        case value:
            return str(value)
