"""Mistakes in the structure of a document of mappings, lists and plain values."""

import copy
import random
from collections.abc import Callable, Sequence
from typing import Any, Final, NamedTuple

_DEEP: Final = 200
# Values in place of others; those of other types than the value are mistakes in any case.
VALUES: Final[tuple[Any, ...]] = (
    *(None, True, False, 0, 1, -1, 2, 3, 0.5, 7, 255, 256, 1000, 65536),
    *(2**31, 2**63, 2**64, -(2**63)),
    *(0.0, -0.0, 1e-3, 1e-9, 1e-300, 5e-324, 1e6, 1e18, 1e300, -1e300, 1.7976931348623157e308),
    *(float("nan"), float("inf"), float("-inf"), 10**400),
    *("", " ", "x", "nan", "inf", "1", "1e5", "None", "null", "true", "\u202e", "ä", "\U0001f41d"),
    *("\x1b[31m", "a\nb", "\x00", "../outside/secret.stl", "/etc/passwd", "/dev/zero", "x" * 5000),
    *("[red]", "%s", "{0}", "${HOME}", "'; --", "<script>", "\ud800"),
    *([], {}, [[]], [None], {"": None}, {"kind": None}, [1, "x"], [0] * 1000, {"kind": "x"}),
)


class _Place(NamedTuple):
    """A value's container, and its key or index there."""

    container: Any
    key: Any


def mutated(document: Any, chance: random.Random, donors: Sequence[Any]) -> Any:
    """Return a copy of a document with one to four mistakes; parts may come from `donors`."""
    document = copy.deepcopy(document)
    for _ in range(chance.choice((1, 1, 1, 2, 2, 3, 4))):
        places = _places(document)
        if places:
            chance.choice(_MISTAKES)(chance.choice(places), chance, places, donors)
    return document


def _places(document: Any) -> list[_Place]:
    """List the places of all values, without those in very long lists."""
    places = []
    remaining = [document]
    while remaining:
        node = remaining.pop()
        if isinstance(node, dict):
            items: list[tuple[Any, Any]] = list(node.items())
        elif isinstance(node, list):
            items = list(enumerate(node[:20]))
        else:
            continue
        places += [_Place(node, key) for key, _ in items]
        remaining += [value for _, value in items if isinstance(value, dict | list)]
        if len(places) > 2000:
            break
    return places


def _extreme(place: _Place, chance: random.Random, *_: Any) -> None:
    place.container[place.key] = copy.deepcopy(chance.choice(VALUES))


def _scaled(place: _Place, chance: random.Random, *_: Any) -> None:
    """Scale a number, so that it is still plausible."""
    value = place.container[place.key]
    if isinstance(value, bool) or not isinstance(value, int | float):
        _extreme(place, chance)
        return
    factor = chance.choice((0, -1, 0.5, 0.9, 1.1, 2, 10, 100, 1e3, 1e6, 1e-3))
    try:
        scaled = value * factor
        place.container[place.key] = round(scaled) if isinstance(value, int) else scaled
    except (OverflowError, ValueError):
        place.container[place.key] = factor


def _removed(place: _Place, *_: Any) -> None:
    if isinstance(place.container, dict):
        del place.container[place.key]
    else:
        place.container.pop(place.key)


def _renamed(place: _Place, chance: random.Random, *_: Any) -> None:
    if isinstance(place.container, dict):
        key = str(place.key)
        at = chance.randrange(len(key) + 1)
        new = chance.choice((key[:at] + key[at + 1 :], f"{key}_mm", key.upper(), "x", "", "kind"))
        place.container[new] = place.container.pop(place.key)
    else:
        chance.shuffle(place.container)


def _moved(place: _Place, chance: random.Random, places: Sequence[_Place], _: Any) -> None:
    """Copy a value to another place, under its own key where that has keys."""
    value = copy.deepcopy(place.container[place.key])
    target = chance.choice(places)
    if isinstance(target.container, dict) and isinstance(place.container, dict):
        target.container[place.key] = value
    elif target.key in (target.container if isinstance(target.container, dict) else ()):
        target.container[target.key] = value
    elif isinstance(target.container, list):
        target.container.append(value)


def _grafted(place: _Place, chance: random.Random, _: Any, donors: Sequence[Any]) -> None:
    """Take a part of another document, at the same key if it has it."""
    donor = _places(chance.choice(donors))
    same = [other for other in donor if other.key == place.key]
    if donor:
        other = chance.choice(same or donor)
        key = place.key if same or isinstance(place.container, list) else other.key
        place.container[key] = copy.deepcopy(other.container[other.key])


def _wrapped(place: _Place, chance: random.Random, *_others: Any) -> None:
    value = place.container[place.key]
    for _ in range(chance.choice((1, 1, 1, 2, 5, _DEEP))):
        value = [value] if chance.random() < 0.5 else {"kind": value}
    place.container[place.key] = value


def _lengthened(place: _Place, chance: random.Random, *_: Any) -> None:
    value = place.container[place.key]
    if isinstance(value, list) and value:
        place.container[place.key] = (value * chance.choice((2, 3, 100)))[:3000]
    elif isinstance(value, str):
        place.container[place.key] = value * chance.choice((2, 1000))
    else:
        _extreme(place, chance)


_MISTAKES: Final[Sequence[Callable[..., None]]] = (
    *(_extreme, _extreme, _scaled, _scaled, _removed, _renamed, _moved, _grafted, _grafted),
    *(_wrapped, _lengthened),
)
