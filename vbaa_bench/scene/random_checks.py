"""Check the distributions of a scene when it is loaded: each value that may be drawn is allowed."""

from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any, Final

from vbaa_bench.scene.distributions import DISTRIBUTIONS, SCALARS, Choice
from vbaa_bench.scene.mistakes import listed_mistakes
from vbaa_bench.scene.part import KeyPath
from vbaa_bench.scene.random_keys import Tree, dotted, nodes, within
from vbaa_bench.scene.random_scene import RejectedDrawError, scene_with
from vbaa_bench.scene.unit_values import Draw, unit_value

# Number of draws; a mistake that all of them have in common does not depend on them. Chosen: one
# that half of the draws have is reported here once in 256 scenes, instead of as a rejection.
_DRAWS: Final = 8


def random_mistakes(path: Path, document: Any, tree: Tree) -> list[str]:
    """List the mistakes in a scene with random keys: those of all draws, then those of extremes.

    Values that are not allowed only together with others are no mistake: such draws are rejected.
    """
    common = _common_errors(tree)
    if common:
        return listed_mistakes(path, document, common)
    mistakes: dict[str, None] = {}
    for key, numbers in _extremes(tree):
        for error in _errors(tree, numbers):
            if error["path"][: len(key)] == key:
                for line in listed_mistakes(path, document, [error]):
                    mistakes.setdefault(f"{line} (one of its random values)")
    return list(mistakes)


def _common_errors(tree: Tree) -> list[Any]:
    """List pydantic's errors that several draws have in common."""
    errors: list[dict[tuple[Any, ...], Any]] = []
    for number in range(_DRAWS):
        try:
            scene_with(tree, partial(unit_value, 0, "uniform", Draw("rig", number)))
        except RejectedDrawError as error:
            errors.append({_identity(one): one for one in error.errors})
        else:
            return []
    shared = set.intersection(*(set(one) for one in errors))
    return [one for key, one in errors[0].items() if key in shared]


def _identity(error: Mapping[str, Any]) -> tuple[Any, ...]:
    # The drawn values of a section do not count: its kind or its keys are wrong.
    value = "" if isinstance(error["input"], Mapping) else str(error["input"])
    return error["type"], error["loc"], value


def _errors(tree: Tree, numbers: Mapping[str, float]) -> Iterator[dict[str, Any]]:
    """Validate a draw with some given numbers; yield pydantic's errors, each with its `path`."""

    def unit(key: str) -> float:
        if key in numbers:
            return numbers[key]
        return unit_value(0, "uniform", Draw("rig", 0), key)

    try:
        scene_with(tree, unit)
    except RejectedDrawError as error:
        for one in error.errors:
            yield {**one, "path": within(tree, one["loc"])}


def _extremes(tree: Tree) -> Iterator[tuple[KeyPath, dict[str, float]]]:
    """Yield every random key with the numbers that draw one of its extreme values, or an option."""
    for path, node in nodes(tree):
        for numbers in _extremes_of(node, dotted(path), path):
            yield path, numbers


def _extremes_of(node: Any, name: str, path: KeyPath) -> Iterator[dict[str, float]]:
    if isinstance(node, SCALARS):
        yield {name: 0.0}
        yield {name: 1.0}
    elif isinstance(node, Choice):
        weights, before = node.relative_weights, 0.0
        for option, weight in zip(node.choice, weights, strict=True):
            if weight > 0:
                number = {name: (before + weight / 2) / sum(weights)}
                yield number
                for inner_name, inner_path, inner in _inner(option, name, path):
                    for numbers in _extremes_of(inner, inner_name, inner_path):
                        yield number | numbers
            before += weight


def _inner(option: Any, name: str, path: KeyPath) -> Iterator[tuple[str, KeyPath, Any]]:
    """Yield the distributions within an option of a choice, with the names of their numbers."""
    if isinstance(option, DISTRIBUTIONS):
        yield f"{name}.choice", path, option
        return
    for inner_path, inner in nodes(option):
        yield dotted((*path, *inner_path)), (*path, *inner_path), inner
