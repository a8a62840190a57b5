"""Random keys of a scene: where its distributions are, and the values that are drawn for them.

A scene's values are a tree of mappings and tuples in which distributions take the place of values.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any, Final

from pydantic import Field

from solver.instrument.errors import truncated
from vbaa_bench.scene.distributions import (
    ADAPTER,
    DISTRIBUTIONS,
    LEVELS,
    SCALARS,
    Choice,
    Distribution,
    From,
    Level,
    elements,
    kind,
)
from vbaa_bench.scene.part import KeyPath, Part

Tree = Any
# Returns the number from 0 to 1 of a key, for each level to be drawn.
Units = Mapping[Level, Callable[[str], float]]

# The most often that keys may be drawn: those of the longest prefix count, others are per rig.
FINEST: Final[dict[KeyPath, Level]] = {
    ("pushes", "contact_distance_mm"): "push",
    ("pushes", "deflection_pct"): "push",
    ("pushes", "pushing_angle_deg"): "push",
    ("pushes", "normal_deg"): "push",
    ("pushes", "stiffness_n_m"): "push",
    ("pushes", "motor_angle_at_contact_deg"): "push",
    ("beam", "grime"): "frame",
    ("ambient",): "frame",
    ("clutter",): "frame",
    ("wires",): "frame",
    ("object",): "push",
    ("object", "texture"): "frame",
    ("object", "paint"): "frame",
    ("object", "reflectance"): "frame",
    ("object", "roughness"): "frame",
    ("second_peg",): "push",
    ("occlusion",): "frame",
    ("light",): "frame",
    ("light_level",): "frame",
    ("lights",): "frame",
    ("background",): "frame",
    ("background", "distance_mm"): "push",
}
# Keys that describe the scene itself.
_FIXED: Final = {("title",), ("seed",), ("rigs",), ("random_method",), ("look",)}
_PLAIN: Final = (str, int, float)
# Lists whose lengths define the grid of pushes: only their items are random.
_GRID: Final = {
    *(path for path in FINEST if path[0] == "pushes"),
    ("occlusion", "kind"),
    ("occlusion", "place"),
    ("occlusion", "availability"),
}


class RandomKey(Part):
    """A key of a scene that is drawn `per` rig, push or frame."""

    key: str = Field(description="The key, with dots between its parts.")
    per: Level = Field(description="How often it is drawn.")
    distribution: Distribution = Field(description="Its distribution.")


class DistributionError(Exception):
    """A mistake in a distribution at `path`: a sentence, or an error of pydantic's."""

    def __init__(self, path: KeyPath, reason: Any) -> None:
        super().__init__(str(reason))
        self.path, self.reason = path, reason


def dotted(path: Sequence[str | int]) -> str:
    """Write a path as a key, such as `lights.0.size_mm`."""
    return ".".join(map(str, path))


def parse(tree: Tree, path: KeyPath = (), parent: Level | None = None) -> Tree:
    """Replace the mappings that state distributions by distributions, each with its level.

    Raises DistributionError.
    """
    if kind(tree) is not None and not isinstance(tree, DISTRIBUTIONS):
        return _parsed(tree, path, parent)
    if isinstance(tree, Mapping):
        return {key: parse(value, (*path, key), parent) for key, value in tree.items()}
    if isinstance(tree, tuple):
        return tuple(parse(value, (*path, i), parent) for i, value in enumerate(tree))
    return tree


def _parsed(node: Mapping[str, Any], path: KeyPath, parent: Level | None) -> Tree:
    """Parse one distribution, and those within it."""
    if path[:1] in _FIXED:
        raise DistributionError(path, "cannot be random")
    vector = elements(node)
    if vector is not None:
        return tuple(_parsed(element, (*path, i), parent) for i, element in enumerate(vector))
    default = "push" if _finest(path) == "push" and path[0] == "pushes" else "rig"
    level = node.get("per", parent or default)
    node = {**node, "per": level}
    for name in ("times", "plus"):
        if kind(node.get(name)):
            number = parse(node[name], (*path, name), level)
            if isinstance(number, tuple):
                raise DistributionError(
                    (*path, name), "is a random vector, allowed is a number or a random number"
                )
            if number.per != level:
                raise DistributionError(
                    (*path, name),
                    f"is drawn per {number.per}, allowed is per: {level}, as the key itself",
                )
            node[name] = number
    if isinstance(node.get("choice"), tuple):
        node["choice"] = tuple(parse(option, path, level) for option in node["choice"])
    try:
        distribution = ADAPTER.validate_python(node)
    except ValueError as error:
        raise DistributionError(path, error) from error
    allowed = LEVELS[LEVELS.index(parent or "rig") : LEVELS.index(_finest(path)) + 1]
    if distribution.per not in allowed:
        raise DistributionError(
            path, f"is drawn per {distribution.per}, allowed is per: {' or '.join(allowed)}"
        )
    if path in _GRID and distribution.per != "rig":
        raise DistributionError(
            path,
            "is a list of fixed length, allowed are distributions of its values, such as "
            f"[{{{kind(node)}: ..}}]",
        )
    return distribution


def _finest(path: KeyPath) -> Level:
    """Return the finest level at which a key may be drawn."""
    if path[-1:] in (("times",), ("plus",)):
        path = path[:-1]
    prefixes = (path[:n] for n in range(len(path), 0, -1))
    return next((FINEST[prefix] for prefix in prefixes if prefix in FINEST), "rig")


def nodes(tree: Tree, path: KeyPath = ()) -> Iterator[tuple[KeyPath, Any]]:
    """Find all distributions of a tree, except those within other distributions."""
    # The most frequent kinds first: tests for pydantic's classes are slow.
    if tree is None or isinstance(tree, _PLAIN):
        return
    if isinstance(tree, dict):
        for key, value in tree.items():
            yield from nodes(value, (*path, key))
    elif isinstance(tree, tuple):
        for i, value in enumerate(tree):
            yield from nodes(value, (*path, i))
    elif isinstance(tree, DISTRIBUTIONS):
        yield path, tree


def random_keys(tree: Tree) -> tuple[RandomKey, ...]:
    """List the random keys of a tree."""
    return tuple(
        RandomKey(key=dotted(path), per=node.per, distribution=node) for path, node in nodes(tree)
    )


def with_random_keys(tree: Tree, keys: Sequence[RandomKey]) -> Tree:
    """Put distributions in the places of their keys."""
    for key in keys:
        tree = replaced(tree, path_of(key.key), key.distribution)
    return tree


def path_of(key: str) -> KeyPath:
    """Split a dotted key; numbers are items of lists."""
    return tuple(int(part) if part.isdigit() else part for part in key.split("."))


def replaced(tree: Tree, path: KeyPath, value: Any) -> Tree:
    """Return a tree with another value at `path`, whose sections exist; `tree` is not changed."""
    if not path:
        return value
    first, *rest = path
    if isinstance(tree, tuple):
        index = int(first)
        return (*tree[:index], replaced(tree[index], tuple(rest), value), *tree[index + 1 :])
    return {**tree, first: replaced(tree[first], tuple(rest), value)}


def within(tree: Tree, location: Sequence[str | int]) -> KeyPath:
    """Return a location of pydantic's as a path in a tree, without the steps of its own.

    Below a distribution nothing is left out.
    """
    path: list[str | int] = []
    for number, part in enumerate(location):
        if isinstance(tree, DISTRIBUTIONS):
            return (*path, *location[number:])
        if _has(tree, part):
            tree = tree[part]
            path.append(part)
    return tuple(path)


def _has(tree: Tree, part: str | int) -> bool:
    """Test whether a section has a key, or a list an item."""
    if isinstance(tree, tuple):
        return isinstance(part, int) and part < len(tree)
    return isinstance(tree, Mapping) and part in tree


def drawn(tree: Tree, units: Units, defaults: Tree) -> Tree:
    """Draw all random keys of the levels in `units`; those of other levels remain.

    A key that a value is computed from and that is not in the tree is looked up in `defaults`.
    Raises DistributionError for a key that does not exist or that has no value yet.
    """
    waiting = [(path, node) for path, node in nodes(tree) if node.per in units]
    while waiting:
        later, progress = [], False
        for path, node in waiting:
            source = partial(_source, tree=tree, defaults=defaults)
            value = _value(node, dotted(path), units, source)
            if value is None:
                later.append((path, node))
                continue
            tree, progress = replaced(tree, path, value.value), True
            # A chosen section may hold distributions.
            later += [(p, one) for p, one in nodes(value.value, path) if one.per in units]
        if not progress:
            path, node = waiting[0]
            raise DistributionError(path, _unresolved(node, tree, defaults))
        waiting = later
    return tree


class _Value:
    """A drawn value, which may itself be None."""

    def __init__(self, value: Any) -> None:
        self.value = value


def _value(node: Any, name: str, units: Units, source: Callable[[str], Any]) -> _Value | None:
    """Draw the value of a distribution; None if it is computed from a key that is not drawn yet."""
    if isinstance(node, SCALARS):
        return _Value(node.value(units[node.per](name)))
    if isinstance(node, Choice):
        option = node.value(units[node.per](name))
        # A distribution as an option has a number of its own.
        if isinstance(option, DISTRIBUTIONS):
            return _value(option, f"{name}.choice", units, source)
        return _Value(option)
    assert isinstance(node, From)
    value = source(node.source)
    if any(True for _ in nodes(value)):
        return None
    if node.times == 1 and node.plus == 0:
        return _Value(value)
    _check_number(f"from {node.source}", value)
    terms = []
    for part, number in (("times", node.times), ("plus", node.plus)):
        inner = _Value(number)
        if isinstance(number, DISTRIBUTIONS):
            drawn_number = _value(number, f"{name}.{part}", units, source)
            if drawn_number is None:
                return None
            inner = drawn_number
        _check_number(part, inner.value)
        terms.append(inner.value)
    return _Value(value * terms[0] + terms[1])


def _check_number(name: str, value: Any) -> None:
    """Raise DistributionError unless a value that a key is computed from is a number."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise DistributionError((), f"{name} is {truncated(repr(value))}, allowed is a number")


def _source(key: str, tree: Tree, defaults: Tree) -> Any:
    """Look up a key in the tree, or else in `defaults`. Raises DistributionError."""
    for place in (tree, defaults):
        node = place
        try:
            for part in path_of(key):
                if isinstance(node, DISTRIBUTIONS):
                    return node
                node = node[part]
        except (KeyError, IndexError, TypeError):
            continue
        return node
    raise DistributionError((), f"is computed from {key}, which does not exist")


def _unresolved(node: Any, tree: Tree, defaults: Tree) -> str:
    assert isinstance(node, From)
    source = next((one for _, one in nodes(_source(node.source, tree, defaults))), node)
    if LEVELS.index(source.per) > LEVELS.index(node.per):
        return (
            f"is drawn per {node.per} from {node.source}, which is drawn per {source.per}; "
            f"add per: {source.per}"
        )
    return f"is computed from {node.source}, which is computed from it"
