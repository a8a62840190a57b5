import ast
from pathlib import Path

from solver.instrument.syntax import syntax_digest
from vbaa_bench.dataset import program

TEXT = '''
"""A module."""

def half(x):
    """Halve."""
    return x / 2  # exactly
'''


def digest(text: str) -> str:
    return syntax_digest(ast.parse(text))


def test_docstrings_comments_and_layout_are_no_code() -> None:
    same = 'def half(x):\n    "Other words."\n    return (x\n        / 2)\n'
    assert digest(same) == digest(TEXT)
    assert digest(TEXT.replace("x / 2", "x * 0.5")) != digest(TEXT)


def test_the_modules_that_make_data_are_found_and_no_others() -> None:
    found = program.code_digests()
    makers = ["generation.truth_row", "generation.frame_renderer", "scene.schema", "scene.frames"]
    makers += ["mechanics.rod", "geometry.tube", "render.frame", "sensor.sensor"]
    makers += ["dataset.writer", "dataset.exr"]
    assert {f"vbaa_bench.{name}" for name in makers} <= found.keys()
    assert {"solver.instrument.camera", "solver.instrument.rig"} <= found.keys()
    rooms = {name.split(".")[1] for name in found if name.startswith("vbaa_bench.")}
    others = {"scoring", "report", "benchmarks", "api", "cli"}
    assert all((Path(program.ROOT) / "vbaa_bench" / room).is_dir() for room in rooms | others)
    assert not rooms & others
    assert not {f"vbaa_bench.generation.{name}" for name in ("workers", "generate")} & found.keys()
    assert not any(name.startswith("solver.methods") for name in found)
