"""Texts of documents with mistakes in their notation: YAML and JSON."""

import io
import json
import random
from typing import Any, Final

from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from tests.robustness.fuzz.damage import damaged

# Share of texts that have mistakes in their notation as well.
_NOTATION: Final = 0.35
# Fragments in place of a value, which no document of plain values has.
FRAGMENTS: Final = (
    *("!!float b", "!!set x", "? key: [1]", "!!omap [1]", "!!int x", "!!binary x", "!!null 1"),
    *("!!timestamp x", "!!pairs x", "!!set {a, b}", "&a [*a]", "<<: [1]", "*a", "? [1]: 2"),
    *("!!python/object/apply:os.system ['true']", "!x y", "!!str 5", "!!bool maybe", "!!seq {}"),
    *(".nan", ".inf", "-.inf", "1e999", "9" * 5000, "0x" + "f" * 300, "0o777", "1_000", "12:30:45"),
    *("2001-01-01", "2001-99-99", "|", ">", "|9", "`", "@", "[", "]", "{", "}", ": ", "#", "~"),
    "'",
    *("'\\ud800'", '"\\ud800"', '"\\0"', '"\\x1b[2J"', "\t", "---", "...", "%FOO x", "[" * 30),
    *("{a: " * 30, "- " * 30, "\x85", "&a {a: *a}", "<<: *a", "{<<: {a: 1}}", "[1, [2, [3]]]"),
    # Distributions, also with odd limits.
    *("{uniform: [1, 2]}", "{uniform: [2, 1]}", "{uniform: 3}", "{uniform: [a, b]}"),
    "{uniform: []}",
    *("{log_uniform: [-1, 2]}", "{integers: [1, 5]}", "{integers: [1.5, 2]}", "{normal: [0, 1]}"),
    *("{normal: [0, -1], clip: [0, 1]}", "{choice: []}", "{choice: {a: 1}}"),
    *("{choice: [[], {}, 1]}", "{choice: [1, x, null], per: frame}", "{from: beam.length_mm}"),
    *("{from: seed, times: x}", "{from: 7}", "{from: a.b.c}", "{from: object}", "per: frame"),
    *("{from: beam.length_mm, times: {choice: [a]}}", "{uniform: [1, 2], choice: [3]}"),
    *("{uniform: [[1, 2], [3, 4]]}", "{uniform: [[1], [2, 3]]}", "{uniform: [1, 2], per: week}"),
    *("{uniform: [1, .inf]}", "{choice: [{choice: [{choice: [1]}]}]}", "per: rig", "1e99", "-1"),
    *("{choice: [{uniform: [1, 2], per: frame}], per: push}", "{integers: [1, 9], per: push}"),
    *("{from: background.reflectance}", "{from: light_level, per: frame}", "{uniform: [0.1, 0.2]}"),
    *("{choice: [matt, gloss]}", "{choice: [1], weights: [0]}", "{from: beam.bow_mm.x}"),
    *("{uniform: [-1.0e+308, 1.0e+308]}", "{log_uniform: [5.0e-324, 1.0e+308]}"),
    "{integers: [-99999999999999999999, 99999999999999999999]}",
    "{normal: [1.0e+308, 1.0e+308]}",
    *("{choice: [1, 2], weights: [.nan, 1]}", "{choice: [1, 2], weights: [1.0e+308, 1.0e+308]}"),
    *("{uniform: [.nan, 1]}", "{normal: [0, 0], clip: [1, 0]}", "{normal: [0, 1], clip: [9, 10]}"),
)


def yaml_text(document: Any, chance: random.Random) -> str:
    """Format a document as YAML, some with mistakes in its notation."""
    yaml = YAML(typ="safe", pure=True)
    yaml.default_flow_style = chance.choice((None, False, True))
    stream = io.StringIO()
    try:
        yaml.dump(document, stream)
        text = stream.getvalue()
    except (YAMLError, ValueError, RecursionError, TypeError, AttributeError):
        # What YAML cannot write, such as half of a surrogate pair: JSON is YAML too.
        text = json.dumps(document, default=str)
    if chance.random() < _NOTATION:
        text = with_notation_mistake(text, chance)
    return text


def json_bytes(document: Any, chance: random.Random) -> bytes:
    """Format a document as JSON, with NaN and Infinity as Python writes them; some damaged."""
    data = json.dumps(document, indent=chance.choice((None, 2)), default=str).encode()
    return damaged(data, chance) if chance.random() < _NOTATION else data


def with_notation_mistake(text: str, chance: random.Random) -> str:
    """Replace a value, insert a fragment, or repeat a line of a document in YAML."""
    lines = text.split("\n")
    for _ in range(chance.randint(1, 2)):
        at = chance.randrange(len(lines))
        key, _, value = lines[at].partition(":")
        fragment, other = chance.choice(FRAGMENTS), chance.choice(lines)
        where = chance.randrange(len(lines[at]) + 1)
        lines[at] = chance.choice(
            (
                *(f"{key}: {fragment}", f"{key}: {fragment}", f"{key}: &a{value}", f"{key}: *a"),
                *(f"{lines[at][:where]}{fragment}{lines[at][where:]}", f"{lines[at]}\n{other}"),
                *(other, f" {lines[at]}", lines[at].lstrip(), f"{lines[at]}\n{lines[at]}"),
            )
        )
    return "\n".join(lines)
