"""Lines of code are those with a token that is neither a comment nor a docstring."""

from pathlib import Path

from results.structure.__main__ import Size, executed, size_of

TEXT = '''"""A module."""

import math  # a remark


def f(x: float) -> float:
    """Say what.

    And more.
    """
    # why
    text = """two
    lines"""
    return math.sin(x) + len(text)
'''
PROGRAM = '''"""A package that calls from one room into another."""

import sys

from vbaa_bench.one import step


def main() -> None:
    """Take a step."""
    step.take(sys.argv[1:])


main()
'''


def test_size_of_a_package(tmp_path: Path) -> None:
    (tmp_path / "inner").mkdir()
    (tmp_path / "inner" / "a.py").write_text(TEXT, encoding="utf-8")
    assert size_of(tmp_path) == Size(modules=1, lines=14, code_lines=5, statements=6)


def test_modules_that_run_and_hand_overs_between_rooms_are_counted(tmp_path: Path) -> None:
    package = tmp_path / "code" / "vbaa_bench"
    for room in ("one", "two"):
        (package / room).mkdir(parents=True)
    (package / "__init__.py").touch()
    (package / "__main__.py").write_text(PROGRAM, encoding="utf-8")
    (package / "one" / "step.py").write_text(
        "from vbaa_bench.two import other, unused\n\n\ndef take(words):\n    other.use(words)\n"
    )
    (package / "two" / "other.py").write_text("def use(words):\n    return len(words)\n")
    (package / "two" / "unused.py").write_text("def use():\n    return 1\n")
    found = executed(tmp_path / "code", ["x"], tmp_path)
    assert found == {"modules": 3, "hand-overs": 2}
