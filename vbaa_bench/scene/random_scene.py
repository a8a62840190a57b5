"""Scenes with random keys: draw the values of a rig, of a push and its frames, or of rest images.

A draw whose values are not allowed together is rejected, and drawn again as its next attempt.
"""

import hashlib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any, Final, TypeVar

from pydantic import ValidationError

from solver.instrument.errors import InputError
from vbaa_bench.scene.distributions import LEVELS, Level
from vbaa_bench.scene.part import KeyPath
from vbaa_bench.scene.random_keys import (
    DistributionError,
    RandomKey,
    Tree,
    Units,
    drawn,
    path_of,
    random_keys,
    with_random_keys,
    within,
)
from vbaa_bench.scene.sampling import SplitSpec
from vbaa_bench.scene.schema import Scene
from vbaa_bench.scene.unit_values import Draw, unit_value

# Attempts before a draw is given up. Derived: if half of the draws are rejected, 64 rejections in a
# row have a probability of 5e-20.
MAX_ATTEMPTS: Final = 64
# Draws that are tried when a scene is loaded, and the share of them that may be rejected. Chosen:
# a share of one half is then known to 3 %, and loading takes less than a second.
TRIED: Final = 256
MAX_REJECTED: Final = 0.5
# Values of keys that a scene does not state.
_DEFAULTS: Final = Scene.model_construct(title="", seed=0).model_dump(
    exclude={"random_keys", "pushes", "sampling"}
)

T = TypeVar("T")


class RejectedDrawError(Exception):
    """Values were drawn that are not allowed together; `path` is the key, the text the reason.

    `errors` are pydantic's, if it has rejected the values.
    """

    def __init__(self, path: KeyPath, reason: str, errors: Sequence[Any] = ()) -> None:
        super().__init__(reason)
        self.path, self.errors = path, errors


def rig_scene(tree: Tree, number: int, attempt: int = 0) -> Scene:
    """Draw one rig of a scene's tree of values: all keys that are random per rig.

    The scene holds the keys that remain random, with the values of a first draw in their places. In
    a collection, each rig has a seed of its own. Raises RejectedDrawError.
    """
    values = _drawn(tree, {"rig": Draw("rig", number, attempt)})
    if values.get("rigs") is not None:
        values = {**values, "seed": _rig_seed(_seed(tree), number), "rigs": None}
        values["splits"] = _rig_splits(tree, number)
    example = _drawn(values, {"push": Draw("push", 0, attempt), "frame": Draw("frame", 0, attempt)})
    return _scene({**example, "random_keys": random_keys(values)})


def scene_with(tree: Tree, unit: Callable[[str], float]) -> Scene:
    """Draw all keys of a tree with given numbers from 0 to 1. Raises RejectedDrawError."""
    return _scene(_with_units(tree, dict.fromkeys(LEVELS, unit)))


def drawn_scene(scene: Scene, draws: Mapping[Level, Draw]) -> Scene:
    """Draw the keys of a scene that remain random. Raises RejectedDrawError."""
    if not scene.random_keys:
        return scene
    values = scene.model_dump(exclude={"random_keys"})
    return _scene(_drawn(with_random_keys(values, scene.random_keys), draws))


def rest_scene(scene: Scene, number: int) -> Scene:
    """Draw the scene of one rest image. Raises InputError if no draw is possible."""
    return accepted(lambda attempt: _rest_scene(scene, number, attempt), f"rest image {number}")


def _rest_scene(scene: Scene, number: int, attempt: int) -> Scene:
    draw = Draw("rest", number, attempt)
    return drawn_scene(scene, {"push": draw, "frame": draw})


def drawn_values(keys: Iterable[RandomKey], drawn: Scene) -> dict[str, Any]:
    """Collect the values of random keys in a drawn scene.

    They are named by key, such as `object.radius_mm`. Those of pushes are left out, because the
    truth has columns for them.
    """
    values = drawn.model_dump(mode="json")
    names = [key.key for key in keys if not key.key.startswith("pushes.")]
    return {name: value for key in names for name, value in _leaves(key, _at(values, key))}


def _at(values: Tree, key: str) -> Any:
    for part in path_of(key):
        values = values[part]
    return values


def _leaves(key: str, value: Any) -> Iterator[tuple[str, Any]]:
    """Yield the plain values of a section or list, each with its key."""
    if isinstance(value, Mapping):
        for name, part in value.items():
            yield from _leaves(f"{key}.{name}", part)
    elif isinstance(value, list):
        for number, part in enumerate(value):
            yield from _leaves(f"{key}.{number}", part)
    else:
        yield key, value


def accepted(make: Callable[[int], T], what: str) -> T:
    """Return the first attempt that is not rejected. Raises InputError after MAX_ATTEMPTS."""
    reasons: list[str] = []
    for attempt in range(MAX_ATTEMPTS):
        try:
            return make(attempt)
        except RejectedDrawError as error:
            reasons.append(str(error))
    ((reason, count),) = Counter(reasons).most_common(1)
    raise InputError(
        f"{what}: {MAX_ATTEMPTS} draws in a row are not possible, {count} of them because {reason}"
    )


def check_draws(tree: Tree) -> None:
    """Draw many rigs, each with a first push. Raises RejectedDrawError if most are rejected."""
    rejected: Counter[tuple[KeyPath, str]] = Counter()
    for number in range(TRIED):
        try:
            rig_scene(tree, number)
        except RejectedDrawError as error:
            rejected[error.path, str(error)] += 1
    if rejected.total() > MAX_REJECTED * TRIED:
        (path, reason), count = rejected.most_common(1)[0]
        raise RejectedDrawError(
            path,
            f"{reason} ({rejected.total()} of {TRIED} draws of the random keys are rejected, "
            f"{count} of them for this reason; allowed is up to half)",
        )


def _drawn(tree: Tree, draws: Mapping[Level, Draw]) -> Tree:
    seed, method = _seed(tree), tree.get("random_method", "uniform")
    units = {level: partial(unit_value, seed, method, draw) for level, draw in draws.items()}
    return _with_units(tree, units)


def _seed(tree: Tree) -> int:
    """Return the seed; that of a scene with a mistake there, which is reported later, is 0."""
    seed = tree.get("seed")
    return seed if isinstance(seed, int) and seed >= 0 else 0


def _with_units(tree: Tree, units: Units) -> Tree:
    try:
        return drawn(tree, units, _DEFAULTS)
    except DistributionError as error:
        raise RejectedDrawError(error.path, str(error.reason)) from error


def _scene(values: Tree) -> Scene:
    try:
        return Scene.model_validate(values)
    except ValidationError as error:
        errors = error.errors()
        first = errors[0]
        reason = str(first.get("ctx", {}).get("error", first["msg"]))
        raise RejectedDrawError(within(values, first["loc"]), reason, errors) from error


def _rig_splits(tree: Tree, number: int) -> Tree:
    """Return the splits of a rig: if rigs are split, all its pushes are in the same one."""
    splits = tree.get("splits")
    if not isinstance(splits, Mapping) or splits.get("by") != "rig":
        return splits
    try:
        name = SplitSpec.model_validate(splits).name(_seed(tree), number)
    except ValidationError:  # reported with the other mistakes of the scene
        return splits
    return {"by": "push", "shares": {name: 1.0}}


def _rig_seed(seed: int, number: int) -> int:
    digest = hashlib.blake2b(f"{seed} rig {number}".encode(), digest_size=8).digest()
    return int.from_bytes(digest) >> 1
