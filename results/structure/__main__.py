"""Size and structure of a version:  python -m results.structure COMMIT...

For each commit, and for the working copy if none is given: modules, lines, lines of code and
statements of the packages; floors of the floor plan; commands; and for one image (`view` of a
scene, `preview` in earlier versions), for one scene (`run` of the quickstart) and for one report
the modules of which a function runs, and the hand-overs: pairs of rooms, one of which calls the
other. Processes that these commands start count. One estimate is that of an image of the example
rig by a tracker, after three others.
"""

import ast
import json
import os
import subprocess
import sys
import tempfile
import tokenize
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, Final, NamedTuple

import typer

from solver.lab.command_end import run_command
from vbaa_bench.cli.options import AsJson
from vbaa_bench.report.console import console, print_result, show_table

ROOT: Final = Path(__file__).parents[2]
PACKAGES: Final = ("vbaa_bench", "solver", "results", "tests")
# Run by every Python process that has its folder on the path, before anything else.
_TRACER: Final = """
import atexit, json, os, sys, threading

_packages = tuple(f"{os.environ['STRUCTURE_ROOT']}/{name}/" for name in ("vbaa_bench", "solver"))
_names, _modules, _pairs = {}, set(), set()


def _name(code):
    found = _names.get(code)
    if found is None:
        path = code.co_filename
        is_module = path.startswith(_packages) and code.co_name != "<module>"
        found = _names[code] = path[len(os.environ["STRUCTURE_ROOT"]) + 1:] if is_module else ""
    return found


def _room(name):
    return "/".join(name.split("/")[:2])


def _called(frame, event, _argument):
    if event == "call":
        name = _name(frame.f_code)
        if name:
            _modules.add(name)
            caller = frame.f_back
            while caller is not None and not _name(caller.f_code):
                caller = caller.f_back
            if caller is not None:
                one, other = _room(_name(caller.f_code)), _room(name)
                if one != other:
                    _pairs.add((one, other))


def begin():
    atexit.register(end)
    threading.setprofile(_called)
    sys.setprofile(_called)


def end():
    sys.setprofile(None)
    with open(f"{os.environ['STRUCTURE_OUT']}/{os.getpid()}.json", "w") as file:
        json.dump({"modules": sorted(_modules), "pairs": sorted(_pairs)}, file)


if "STRUCTURE_ALL" in os.environ:
    begin()
"""
_ONE_ESTIMATE: Final = """
import os, sys
from pathlib import Path
import cv2, solver
rig = solver.open_rig("solver/example")
tracker = rig.tracker("exact_fit")
paths = sorted(Path("solver/example/images").glob("*.png"))[:4]
images = [cv2.imread(str(path), cv2.IMREAD_GRAYSCALE) for path in paths]
for image in images[:-1]:
    tracker.update(image)
sys.path.insert(0, os.environ["STRUCTURE_TRACER"])
import sitecustomize as tracer
tracer.begin()
assert tracker.update(images[-1]).values
tracer.end()
"""
_LIST_COMMANDS: Final = """
import json, typer
from vbaa_bench.cli.main import app
def names(name, command):
    commands = getattr(command, "commands", None)
    if commands is None:
        return [name]
    return [name for item in commands.items() for name in names(*item)]
print(json.dumps(names("", typer.main.get_command(app))))
"""


class Size(NamedTuple):
    """Size of a package."""

    modules: int
    lines: int
    code_lines: int
    statements: int


def size_of(folder: Path) -> Size:
    """Count the modules of a package; code lines have a token that is no comment or docstring."""
    paths = sorted(folder.rglob("*.py"))
    texts = [path.read_text(encoding="utf-8") for path in paths]
    statements = sum(
        isinstance(node, ast.stmt) for text in texts for node in ast.walk(ast.parse(text))
    )
    code = sum(len(set(_code_lines(path))) for path in paths)
    return Size(len(paths), sum(text.count("\n") for text in texts), code, statements)


def _code_lines(path: Path) -> Iterator[int]:
    blank = {
        *(tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT),
        *(tokenize.ENDMARKER, tokenize.ENCODING),
    }
    with tokenize.open(path) as file:
        before = tokenize.NEWLINE
        for token in tokenize.generate_tokens(file.readline):
            is_docstring = token.type == tokenize.STRING and before in blank
            if token.type not in blank and not is_docstring:
                yield from range(token.start[0], token.end[0] + 1)
            if token.type not in {tokenize.COMMENT, tokenize.NL}:
                before = token.type


def executed(code: Path, words: list[str], folder: Path) -> dict[str, int]:
    """Run a command of a version; count the modules that run, and the hand-overs."""
    return _counted(code, ["-m", "vbaa_bench", *words], folder, whole=True)


def one_estimate(code: Path, folder: Path) -> dict[str, int]:
    """Count the modules, and the hand-overs, of one estimate of a version."""
    return _counted(code, ["-c", _ONE_ESTIMATE], folder, whole=False)


def _counted(code: Path, words: list[str], folder: Path, *, whole: bool) -> dict[str, int]:
    """Run Python; count modules and hand-overs of the `whole` process, or of what it chooses."""
    tracer, out = folder / "tracer", folder / "out"
    for path in (tracer, out):
        path.mkdir(exist_ok=True)
    for path in out.iterdir():
        path.unlink()
    (tracer / "sitecustomize.py").write_text(_TRACER, encoding="utf-8")
    environment = os.environ | {
        "PYTHONPATH": f"{tracer}{os.pathsep}{code}" if whole else str(code),
        "STRUCTURE_ROOT": str(code),
        "STRUCTURE_OUT": str(out),
        "STRUCTURE_TRACER": str(tracer),
        **({"STRUCTURE_ALL": "1"} if whole else {}),
    }
    subprocess.run(
        [sys.executable, *words], cwd=code, env=environment, check=True, capture_output=True
    )
    records = [json.loads(path.read_text(encoding="utf-8")) for path in out.iterdir()]
    modules = {name for record in records for name in record["modules"]}
    pairs = {tuple(pair) for record in records for pair in record["pairs"]}
    return {"modules": len(modules), "hand-overs": len(pairs)}


def structure(code: Path) -> dict[str, Any]:
    """Measure a version that is checked out in a folder."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        run, scene = folder / "run", "scenes/quickstart.yaml"
        environment = os.environ | {"PYTHONPATH": str(code)}
        listed = subprocess.run(
            [sys.executable, "-c", _LIST_COMMANDS],
            cwd=code,
            env=environment,
            check=True,
            capture_output=True,
            text=True,
        )
        commands = json.loads(listed.stdout)
        one_image = "preview" if "preview" in commands else "view"
        return {
            **{package: size_of(code / package)._asdict() for package in PACKAGES},
            "floors": _floors(code / "tests" / "test_floor_plan.py"),
            "commands": len(commands),
            "one estimate": one_estimate(code, folder),
            "one image": executed(code, [one_image, scene, "--out", f"{folder}/a.png"], folder),
            "one scene": executed(code, ["run", scene, "--out", str(run)], folder),
            "one report": executed(code, ["report", str(run)], folder),
        }


def _floors(path: Path) -> dict[str, int]:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    (plan,) = (
        node.value
        for node in tree.body
        if isinstance(node, ast.AnnAssign) and getattr(node.target, "id", "") == "FLOORS"
    )
    assert plan is not None
    return {package: len(floors) for package, floors in ast.literal_eval(plan).items()}


def _of_commit(commit: str) -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as name:
        code = Path(name) / "code"
        git = ["git", "-C", str(ROOT), "worktree"]
        subprocess.run([*git, "add", "--quiet", "--detach", str(code), commit], check=True)
        try:
            return structure(code)
        finally:
            subprocess.run([*git, "remove", "--force", str(code)], check=True)


app = typer.Typer()


@app.command()
def main(
    commits: Annotated[list[str] | None, typer.Argument(help="commits", show_default=False)] = None,
    as_json: AsJson = False,
) -> None:
    """Measure size and structure of versions of this project, side by side."""
    found: dict[str, dict[str, Any]] = {}
    with console.status("counting and running"):
        for commit in commits or ():
            found[commit] = _of_commit(commit)
        if not commits:
            found["here"] = structure(ROOT)
    if as_json:
        print_result(found, "", True)
        return
    first = next(iter(found.values()))
    rows = []
    for name, value in first.items():
        for key in value if isinstance(value, dict) else ("",):
            cells = [one[name][key] if key else one[name] for one in found.values()]
            rows.append((f"{name} {key}".strip(), *(f"{cell:,}" for cell in cells)))
    show_table("size and structure", ("", *found), rows)


if __name__ == "__main__":
    run_command(app)
