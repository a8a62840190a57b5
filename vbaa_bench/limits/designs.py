"""Designs to compare: a scene, and copies of it with other values of some keys."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path

from solver.instrument.errors import InputError, quoted
from vbaa_bench.assembly.plan import accepted_rig, rig_mistakes
from vbaa_bench.limits.places import scene_of_map
from vbaa_bench.scene.load import SceneFile, load_scene


@dataclass(frozen=True)
class Design:
    """A scene with some values replaced by `settings`, such as "beam.diameter_mm=0.4".

    `file` has the scene of its map; it is None if the design is impossible for a `reason`.
    """

    name: str
    settings: tuple[str, ...]
    file: SceneFile | None
    reason: str = ""


def designs(
    path: Path,
    variations: Sequence[str],
    information: str,
    seed: int | None = None,
    settings: Sequence[str] = (),
) -> tuple[Design, ...]:
    """Combine all values of all variations, such as "beam.diameter_mm=0.4,0.8".

    Keys that change together are joined by +, and so are their values:
    "camera.width_px+camera.height_px=256+256,512+512"; a single value counts for all of them.
    Raises InputError, also if no design is possible.
    """
    axes = [_choices(variation) for variation in variations]
    keys = [setting.partition("=")[0] for axis in axes for setting in axis[0]]
    naming = [_distinct(axis) for axis in axes]
    combined = []
    for choices in product(*axes):
        own = tuple(setting for choice in choices for setting in choice)
        named = [choice[i] for choice, places in zip(choices, naming, strict=True) for i in places]
        name = ", ".join(_short(setting, keys) for setting in named) or path.stem
        try:
            file = accepted_rig(load_scene(path, seed, (*settings, *own)))
            if mistakes := rig_mistakes(file):
                raise InputError("; ".join(mistakes))
            combined.append(Design(name, own, scene_of_map(file, information)))
        except InputError as error:
            combined.append(Design(name, own, None, str(error)))
    if not any(design.file for design in combined):
        raise InputError("\n".join(dict.fromkeys(design.reason for design in combined)))
    return tuple(combined)


def _choices(variation: str) -> list[tuple[str, ...]]:
    """List the settings of each value of a variation."""
    names, equals, values = variation.partition("=")
    keys = names.split("+")
    choices = []
    for text in _split(values, ","):
        parts = _split(text, "+") if len(keys) > 1 else [text]
        parts = parts * len(keys) if len(parts) == 1 else parts
        if len(parts) != len(keys):
            raise InputError(
                f"--vary is {quoted(variation)}, but {quoted(text)} has {len(parts)} values, "
                f"allowed are 1 and {len(keys)}, as many as keys"
            )
        choices.append(tuple(f"{key}={part}" for key, part in zip(keys, parts, strict=True)))
    if not equals or not all(keys) or "" in _split(values, ","):
        raise InputError(f"--vary is {quoted(variation)}, allowed is KEY=VALUE,VALUE,...")
    return choices


def _split(text: str, separator: str) -> list[str]:
    """Split a text at separators that are not within brackets."""
    parts, depth = [""], 0
    for letter in text:
        depth += (letter in "[{") - (letter in "]}")
        if letter == separator and not depth:
            parts.append("")
        else:
            parts[-1] += letter
    return parts


def _distinct(choices: Sequence[tuple[str, ...]]) -> Sequence[int]:
    """Find the first key whose values distinguish all choices; all keys if there is none."""
    columns = list(zip(*choices, strict=True))
    return next(
        ([i] for i, column in enumerate(columns) if len(set(column)) == len(choices)),
        range(len(columns)),
    )


def _short(setting: str, keys: Sequence[str]) -> str:
    """Shorten a setting to the last part of its key, unless other keys end with the same."""
    key, _, value = setting.partition("=")
    last = key.rpartition(".")[2]
    alike = {other for other in keys if other.rpartition(".")[2] == last}
    return f"{last if len(alike) == 1 else key} {value}"
