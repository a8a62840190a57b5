"""The floor plan: which room may import from which."""

import ast
import functools
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parent.parent

# Top floor first. A module imports from its own room and from lower floors only.
FLOORS: dict[str, list[set[str]]] = {
    "vbaa_bench": [
        {"__init__", "__main__"},
        {"cli"},
        {"suite"},
        {"api"},
        {"benchmarks", "kinds", "limits", "viewer"},
        {"generation", "report"},
        {"assembly", "exports", "regression"},
        {"render", "scoring", "workers"},
        {"dataset", "sensor"},
        {"scene"},
        {"geometry", "mechanics"},
        {"extra"},
    ],
    "solver": [
        {"__init__", "__main__"},
        {"api"},
        {"lab"},
        {"learning"},
        {"tracker"},
        {"to_measurement", "set_up"},
        {"antenna", "first_start", "photographs"},
        {"at_rest", "methods", "outline", "tracing"},
        {"baselines", "calibrate", "centreline"},
        {"fitting"},
        {"uniform"},
        {"beams"},
        {"core", "planes"},
        {"instrument"},
    ],
}
# Only these may use the solver beyond its words.
CALLERS_OF_THE_SOLVER = {"scoring", "benchmarks", "cli", "api", "suite"}
HEAVY = {"mitsuba", "drjit", "trimesh", "OpenEXR", "polars", "pydantic", "ruamel"}


def modules(package: str) -> list[Path]:
    found = sorted((ROOT / package).rglob("*.py"))
    assert found
    return found


@functools.cache
def tree_of(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


@functools.cache
def imports(path: Path) -> set[str]:
    names: set[str] = set()
    for node in ast.walk(tree_of(path)):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path} imports relatively"
            names.add(str(node.module))
    return names


def floor(package: str, room: str) -> int:
    return next(i for i, rooms in enumerate(FLOORS[package]) if room in rooms)


# One test for all modules of a rule: a thousand tests of a millisecond each take twenty seconds.
def test_modules_import_only_downward() -> None:
    upward = []
    for path in [*modules("solver"), *modules("vbaa_bench")]:
        package, here = path.relative_to(ROOT).with_suffix("").parts[:2]
        for name in imports(path):
            top, _, rest = name.partition(".")
            room = rest.partition(".")[0] or "__init__"
            if top == package and room != here and floor(package, room) <= floor(package, here):
                upward.append(f"{path} imports {name}")
    assert upward == []


def test_neither_package_needs_its_laboratory_or_its_tests() -> None:
    wrong = [
        f"{path} imports {name}"
        for path in [*modules("solver"), *modules("vbaa_bench")]
        for name in imports(path)
        if name.partition(".")[0] in {"results", "tests"}
    ]
    assert wrong == []


def test_the_antenna_knows_neither_the_world_nor_its_tools() -> None:
    wrong = []
    for path in modules("solver"):
        tops = {name.split(".")[0] for name in imports(path)}
        wrong += [f"{path} imports {top}" for top in tops & (HEAVY | {"vbaa_bench"})]
        if "vbaa_bench" in path.read_text(encoding="utf-8"):
            wrong.append(f"{path} names vbaa_bench")
    assert wrong == []


def test_the_world_keeps_to_its_own_tools() -> None:
    wrong = []
    for path in modules("vbaa_bench"):
        here = path.relative_to(ROOT / "vbaa_bench").parts[0].removesuffix(".py")
        for name in imports(path):
            allowed = (
                (
                    not name.startswith("solver")
                    or here in CALLERS_OF_THE_SOLVER
                    or name.startswith("solver.instrument")
                )
                and (name.split(".")[0] not in {"mitsuba", "drjit"} or here == "render")
                # World and antenna share no physics.
                and not name.startswith("solver.beams")
            )
            if not allowed:
                wrong.append(f"{path} imports {name}")
    assert wrong == []


def test_the_page_of_the_laboratory_lists_its_modules() -> None:
    folder = ROOT / "solver" / "lab"
    page = str(ast.get_docstring(tree_of(folder / "__init__.py")))
    modules_of = {path.stem for path in folder.glob("*.py")} - {"__init__"}
    assert set(re.findall(r"`(\w+)`", page)) == modules_of


def test_each_tree_is_opened_in_one_place() -> None:
    def definers(function: str) -> list[str]:
        found = []
        for package in ("solver", "vbaa_bench"):
            for path in modules(package):
                body = tree_of(path).body
                if any(isinstance(n, ast.FunctionDef) and n.name == function for n in body):
                    found.append(str(path.relative_to(ROOT)))
        return found

    assert definers("open_observations") == ["solver/instrument/observation.py"]
    assert definers("open_truth") == ["vbaa_bench/dataset/readers.py"]
    for path in modules("solver"):
        assert "open_truth" not in path.read_text(encoding="utf-8")


_WITHOUT = """
import sys

class Absent:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in {names!r}:
            raise ModuleNotFoundError(name + " is not installed here", name=name)

sys.meta_path.insert(0, Absent())
from solver.__main__ import main
main()
"""


def test_the_solver_runs_without_the_world(dataset: Path, tmp_path: Path) -> None:
    # typer itself brings pydantic.
    code = _WITHOUT.format(names=(HEAVY - {"pydantic"}) | {"vbaa_bench"})
    out = tmp_path / "estimates.csv"
    command = [sys.executable, "-c", code, str(dataset / "observations"), "--out", str(out)]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "exact_fit" in done.stdout
    assert len(out.read_text(encoding="utf-8").splitlines()) == 5
