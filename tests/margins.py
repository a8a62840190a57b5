"""Measure by how many standard deviations each assertion of a test is met, over seeds.

`make seeds PART=k/n` runs part k of n of the tests that draw random numbers, once for each of 20
seeds, and prints every assertion that failed or that is met by fewer than five standard deviations.
The standard deviation of 20 values is known to a sixth: an assertion falls short if a margin of
five would show as little in one of a hundred cases only, which is 3.6 with 20 seeds.

An import hook takes the place of pytest's: it rewrites each comparison of an assertion so that the
values on both sides are recorded, those of arrays, too. Per seed, the element nearest to its limit
counts. Over the seeds, values are compared on a scale on which they are nearly normal, so that five
standard deviations are rare (3e-7):

- a signed error, in units of its limit: as it is. Signed are `x == pytest.approx(y)`,
  `abs(x) < y` and `assert_allclose`, of single numbers;
- two positive numbers that both change from seed to seed, such as two RMS errors: the logarithm of
  their ratio (Fisher's z);
- one positive number and a constant positive limit: its power 2/3. It is the cube root of a sum of
  squares (Wilson & Hilferty, 1931) for a root mean square or the magnitude of a normal error, and
  that of Anscombe (1953) for a Poisson count. The largest of 100 normal errors exceeds five
  standard deviations of this scale with a probability of 3e-5, of a plain one with 1e-4;
- all else: the difference.

Equalities, and comparisons of numbers that do not change with the seed, have no margin: they hold
for all seeds, or fail for some. A test whose rate of false alarms is known in closed form states
it by `@pytest.mark.false_alarm(rate, "derivation")`; its margins are not measured.

A test whose margins are all above fifteen in the first eight seeds is not run with the others: if
one of them were five, eight seeds would show fifteen with a probability of 0.2 % (chi-square of
seven degrees of freedom). Nor is a test without a margin that has passed with all eight.

With `--keep FOLDER` the record of each seed stays, and the same command continues after it.
"""

import argparse
import ast
import functools
import importlib.abc
import importlib.machinery
import json
import math
import os
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Collection, Sequence
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any, Final, Literal, NamedTuple

import numpy as np
import pytest
from scipy.stats import chi2

from solver.instrument.arrays import Floats

SEEDS: Final = 20
ENOUGH: Final = 5.0
SCREENING_SEEDS: Final = 8
CLEAR: Final = 15.0
LARGEST_FALSE_ALARM: Final = 1e-5
ROOT: Final = Path(__file__).parent.parent


class Closest(NamedTuple):
    """The element of an assertion's comparisons that is nearest to its limit, in one seed."""

    kind: Literal["signed", "plain"]
    low: float  # the limit is 1 for a signed one, of which this is the ratio to its limit
    high: float
    compared: int  # numbers, in all comparisons

    @property
    def slack(self) -> float:
        """Distance to the limit: relative where both numbers are positive."""
        if self.kind == "signed":
            return 1.0 - abs(self.low)
        return float(_slack(np.array(self.low), np.array(self.high)))


def _slack(low: Floats, high: Floats) -> Floats:
    if (low >= 0).all() and (high > 0).all():
        return 1.0 - low / high
    return high - low


def margin(seeds: Sequence[Closest]) -> float | None:
    """Return the margin of an assertion [standard deviations], None where nothing changes."""
    low = np.array([one.low for one in seeds], float)
    high = np.array([one.high for one in seeds], float)
    if len(seeds) < 2 or (np.ptp(low) == 0 and np.ptp(high) == 0):
        return None
    if seeds[0].kind == "signed" and all(one.compared == 1 for one in seeds):
        return float((1.0 - abs(low.mean())) / low.std(ddof=1))
    if seeds[0].kind == "signed":  # the largest of several has either sign
        low = np.abs(low)
    if (low < 0).any() or (high < 0).any():
        slack = high - low
    elif np.ptp(low) > 0 and np.ptp(high) > 0 and (low > 0).all() and (high > 0).all():
        slack = np.log(high / low)
    else:
        slack = high ** (2 / 3) - low ** (2 / 3)
    return float(slack.mean() / slack.std(ddof=1)) if np.ptp(slack) else None


class Recorder:
    """Plugin of pytest that records the comparisons of all tests of a run, as lines of JSON."""

    def __init__(self, path: Path, part: tuple[int, int], left_out: Collection[str]) -> None:
        self.path = path
        self.part = part
        self.left_out = left_out
        self.closest: dict[str, Closest] = {}
        self.failed = False

    def add(self, where: str, kind: Literal["signed", "plain"], low: Any, high: Any) -> None:
        """Keep the element nearest to its limit."""
        try:
            low, high = np.broadcast_arrays(np.asarray(low, float), np.asarray(high, float))
        except (TypeError, ValueError):
            return  # no numbers
        finite = np.isfinite(low) & np.isfinite(high)
        low, high = low[finite], high[finite]
        if low.size == 0:
            return
        slack = 1.0 - np.abs(low) if kind == "signed" else _slack(low, high)
        at = np.argmin(slack)
        new, old = Closest(kind, float(low[at]), float(high[at]), low.size), self.closest.get(where)
        compared = new.compared + (0 if old is None else old.compared)
        nearer = new if old is None or new.slack < old.slack else old
        self.closest[where] = nearer._replace(compared=compared)

    def compare(
        self, where: str, operators: tuple[str, ...], absolute: tuple[bool, ...], *values: Any
    ) -> Any:
        """Compare as Python does, and record. An `absolute` value is replaced by its magnitude."""
        true = [abs(value) if flag else value for value, flag in zip(values, absolute, strict=True)]
        result: Any = True
        for k, operator in enumerate(operators):
            name = where if len(operators) == 1 else f"{where}.{k}"
            left, right = values[k], values[k + 1]
            if operator == "==":
                result = true[k] == true[k + 1]
                self._add_approximate(name, true[k], true[k + 1])
            else:
                result = _OPERATORS[operator](true[k], true[k + 1])
                ends = ((true[k], left, absolute[k]), (true[k + 1], right, absolute[k + 1]))
                low, high = ends if operator[0] == "<" else ends[::-1]
                self._add_ordered(name, low, high)
            if k < len(operators) - 1 and not result:
                break
        return result

    def _add_ordered(self, where: str, low: Any, high: Any) -> None:
        magnitude, signed, is_magnitude = low
        try:
            if is_magnitude and not np.iscomplexobj(signed) and (np.asarray(high[0]) > 0).all():
                with np.errstate(invalid="ignore", over="ignore"):
                    self.add(where, "signed", np.asarray(signed) / np.asarray(high[0]), 1.0)
            else:
                self.add(where, "plain", magnitude, high[0])
        except TypeError:
            pass  # no numbers

    def _add_approximate(self, where: str, left: Any, right: Any) -> None:
        actual, wanted = (left, right) if hasattr(right, "_approx_scalar") else (right, left)
        if not hasattr(wanted, "_approx_scalar"):
            return
        try:
            pairs = list(wanted._yield_comparisons(actual))
        except (AttributeError, NotImplementedError, TypeError):
            pairs = [(actual, wanted.expected)]
        ratios = []
        for a, expected in pairs:
            if all(isinstance(x, (int, float, np.integer, np.floating)) for x in (a, expected)):
                tolerance = wanted._approx_scalar(expected).tolerance
                ratios += [(float(a) - float(expected)) / tolerance] if tolerance > 0 else []
        self.add(where, "signed", ratios, 1.0)

    def assert_allclose(
        self, actual: Any, desired: Any, rtol: float = 1e-7, atol: float = 0.0, **others: Any
    ) -> None:
        """Assert as NumPy does, and record."""
        caller = sys._getframe(1)
        limit = atol + rtol * np.abs(np.asarray(desired, float))
        with np.errstate(invalid="ignore", divide="ignore"):
            error = (np.asarray(actual, float) - np.asarray(desired, float)) / limit
        where = f"{Path(caller.f_code.co_filename).relative_to(ROOT)}:{caller.f_lineno}"
        self.add(where, "signed", error, 1.0)
        _ALLCLOSE(actual, desired, rtol=rtol, atol=atol, **others)

    def pytest_collection_modifyitems(
        self, config: pytest.Config, items: list[pytest.Item]
    ) -> None:
        """Keep the tests that draw numbers, and of these one part: evenly, for even times."""
        drawing = [item for item in items if _draws(item)]
        number, parts = self.part
        kept = [item for item in drawing[number - 1 :: parts] if item.nodeid not in self.left_out]
        for item in kept:
            marker = item.get_closest_marker("false_alarm")
            if marker is not None and marker.args[0] > LARGEST_FALSE_ALARM:
                raise pytest.UsageError(f"{item.nodeid}: a false alarm is too frequent")
        others = set(items) - set(kept)
        config.hook.pytest_deselected(items=[item for item in items if item in others])
        items[:] = kept

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Note a failure."""
        self.failed |= report.failed

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Any:
        """Record one test."""
        self.closest, self.failed, start = {}, False, time.monotonic()
        result = yield
        marker = item.get_closest_marker("false_alarm")
        line = {
            "test": item.nodeid,
            "failed": self.failed,
            "seconds": time.monotonic() - start,
            "false_alarm": None if marker is None else marker.args,
            "closest": self.closest,
        }
        with self.path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(line) + "\n")
        return result


_ALLCLOSE: Final = np.testing.assert_allclose
_OPERATORS: Final[dict[str, Any]] = {
    "<": lambda a, b: a < b,
    "<=": lambda a, b: a <= b,
    ">": lambda a, b: a > b,
    ">=": lambda a, b: a >= b,
}
_NAMES: Final = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "=="}


class Rewriter(ast.NodeTransformer):
    """Rewriter of the comparisons that must all hold for an assertion to hold."""

    def __init__(self, file: str) -> None:
        self.file = file

    def visit_Assert(self, node: ast.Assert) -> ast.Assert:  # the name that ast calls
        """Rewrite one assertion."""
        node.test = self._recorded(node.test)
        return node

    def _recorded(self, node: ast.expr) -> ast.expr:
        match node:
            case ast.BoolOp(op=ast.And()):
                node.values = [self._recorded(value) for value in node.values]
            case ast.Compare() if all(type(op) in _NAMES for op in node.ops):
                return self._comparison(node)
            case ast.Call(func=ast.Name(id="all"), args=[ast.GeneratorExp() as each]):
                each.elt = self._recorded(each.elt)
            case ast.Call(func=ast.Attribute(value=inner, attr="all") as function, args=[]):
                function.value = self._recorded(inner)
            case ast.Call(func=ast.Attribute(value=ast.Name(id="np"), attr="all"), args=[inner]):
                node.args = [self._recorded(inner)]
        return node

    def _comparison(self, node: ast.Compare) -> ast.expr:
        values, absolute = [], []
        for value in (node.left, *node.comparators):
            match value:
                case ast.Call(
                    func=ast.Name(id="abs") | ast.Attribute(value=ast.Name(id="np"), attr="abs"),
                    args=[inner],
                    keywords=[],
                ):
                    values.append(inner)
                    absolute.append(True)
                case _:
                    values.append(value)
                    absolute.append(False)
        where = f"{self.file}:{node.lineno}:{node.col_offset}"
        operators = tuple(_NAMES[type(op)] for op in node.ops)
        call = ast.parse(f"__compare__({where!r}, {operators!r}, {tuple(absolute)!r})", mode="eval")
        assert isinstance(call.body, ast.Call)
        call.body.args += values
        return ast.fix_missing_locations(ast.copy_location(call.body, node))


class Loader(importlib.machinery.SourceFileLoader):
    """Loader of modules whose assertions are recorded."""

    def __init__(self, name: str, path: str, recorder: Recorder) -> None:
        super().__init__(name, path)
        self.recorder = recorder

    def get_code(self, fullname: str) -> CodeType:
        """Compile the rewritten source, whatever bytecode is kept."""
        path = Path(self.get_filename(fullname))
        tree = ast.parse(path.read_bytes(), path)
        rewritten = Rewriter(str(path.relative_to(ROOT))).visit(tree)
        return compile(rewritten, path, "exec", dont_inherit=True)

    def exec_module(self, module: ModuleType) -> None:
        """Execute with the function that records."""
        module.__dict__["__compare__"] = self.recorder.compare
        super().exec_module(module)


class Finder(importlib.abc.MetaPathFinder):
    """Finder of the modules of tests/."""

    def __init__(self, recorder: Recorder) -> None:
        self.recorder = recorder

    def find_spec(
        self, name: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> importlib.machinery.ModuleSpec | None:
        """Find a module of tests/ as Python does, but for its loader."""
        if not name.startswith("tests."):
            return None
        spec = importlib.machinery.PathFinder.find_spec(name, path, target)
        if spec is not None and isinstance(spec.loader, importlib.machinery.SourceFileLoader):
            spec.loader = Loader(name, spec.loader.path, self.recorder)
        return spec


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add where to record to, and which part of the tests."""
    parser.addoption("--margins", type=Path)
    parser.addoption("--part", type=part_of, default=(1, 1))
    parser.addoption("--left-out", type=Path)


def pytest_configure(config: pytest.Config) -> None:
    """Record all modules that are imported from now on."""
    left_out = set(json.loads(config.getoption("--left-out").read_text("utf-8")))
    recorder = Recorder(config.getoption("--margins"), config.getoption("--part"), left_out)
    config.pluginmanager.register(recorder)
    vars(np.testing)["assert_allclose"] = recorder.assert_allclose
    sys.meta_path.insert(0, Finder(recorder))


def part_of(text: str) -> tuple[int, int]:
    """Read k/n."""
    number, parts = map(int, text.split("/"))
    if not 1 <= number <= parts:
        raise ValueError(text)
    return number, parts


@functools.cache
def _imports_draws(path: Path) -> bool:
    """Return whether a module of tests/ draws numbers, itself or by those that it imports."""
    names = set()
    for node in ast.walk(ast.parse(path.read_bytes())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            names |= {str(node.module)} | {f"{node.module}.{alias.name}" for alias in node.names}
    if "tests.draws" in names:
        return True
    files = (ROOT / f"{name.replace('.', '/')}.py" for name in names if name.startswith("tests."))
    return any(_imports_draws(file) for file in files if file.exists())


def _draws(item: pytest.Item) -> bool:
    fixtures = set(getattr(item, "fixturenames", ()))
    drawn_by_hypothesis = getattr(getattr(item, "obj", None), "is_hypothesis_test", False)
    return bool(
        fixtures & {"random", "small_scene"} or drawn_by_hypothesis or _imports_draws(item.path)
    )


class Row(NamedTuple):
    """An assertion, or a test that failed, over all seeds."""

    test: str
    where: str
    margin: float | None
    worst: Closest | None
    failed_seeds: tuple[int, ...]
    measured: int = 0  # seeds

    @property
    def falls_short(self) -> bool:
        """Whether the test failed, or the margin is below ENOUGH beyond its own error."""
        if self.margin is None:
            return True
        freedom = self.measured - 1
        return bool(self.margin * np.sqrt(chi2.isf(0.01, freedom) / freedom) < ENOUGH)


def table(runs: Sequence[Sequence[dict[str, Any]]]) -> list[Row]:
    """Return the assertions of all tests, those with the smallest margins first."""
    closest: dict[tuple[str, str], list[Closest]] = defaultdict(list)
    failed: dict[str, list[int]] = defaultdict(list)
    for seed, run in enumerate(runs):
        for line in run:
            if line["failed"]:
                failed[line["test"]].append(seed)
            if line["false_alarm"] is None:
                for where, one in line["closest"].items():
                    closest[line["test"], where].append(Closest(*one))
    rows = [Row(test, "", None, None, tuple(seeds)) for test, seeds in failed.items()]
    measured = [
        Row(test, where, margin(seeds), min(seeds, key=lambda one: one.slack), (), len(seeds))
        for (test, where), seeds in closest.items()
    ]
    measured = [row for row in measured if row.margin is not None]
    return rows + sorted(measured, key=lambda row: row.margin or 0.0)


def clear_tests(runs: Sequence[Sequence[dict[str, Any]]]) -> list[str]:
    """List the tests that need no further seeds: all margins are large, or there is none."""
    least = {line["test"]: math.inf for run in runs for line in run}
    for row in table(runs):
        least[row.test] = min(least[row.test], 0.0 if row.margin is None else row.margin)
    return [test for test, value in least.items() if value >= CLEAR]


def main() -> int:
    """Run the tests with all seeds and print what falls short."""
    parser = argparse.ArgumentParser(description="Measure the margins of the tests over seeds")
    parser.add_argument("--part", default="1/1")
    parser.add_argument("--seeds", type=int, default=SEEDS)
    parser.add_argument("--keep", type=Path, help="folder of the records, with which it continues")
    parser.add_argument("tests", nargs="*", default=["tests"])
    options = parser.parse_args()
    part_of(options.part)
    start = time.monotonic()
    with tempfile.TemporaryDirectory() as temporary:
        folder = options.keep or Path(temporary)
        folder.mkdir(exist_ok=True)
        runs = list[list[dict[str, Any]]]()
        left_out = folder / "left_out.json"
        for seed in range(options.seeds):
            path, unfinished = folder / f"{seed}.jsonl", folder / f"{seed}.part"
            if path.exists():
                runs.append(_read(path))
                continue
            clear = clear_tests(runs) if seed >= SCREENING_SEEDS else []
            left_out.write_text(json.dumps(clear), "utf-8")
            unfinished.unlink(missing_ok=True)
            command = [sys.executable, "-m", "pytest", "-q", "--no-header", "--no-summary"]
            command += ["--assert=plain", "-p", "tests.margins", f"--margins={unfinished}"]
            command += [f"--part={options.part}", f"--left-out={left_out}", *options.tests]
            environment = {**os.environ, "VBAA_TEST_SEED": str(seed)}
            code = subprocess.run(
                command, cwd=ROOT, env=environment, check=False, stdout=subprocess.DEVNULL
            ).returncode
            if code not in (0, 1, pytest.ExitCode.NO_TESTS_COLLECTED):
                print(f"pytest ended with {code}: {' '.join(command)}")
                return code
            unfinished.touch()  # no test, no record
            unfinished.rename(path)
            runs.append(_read(path))
            seconds = time.monotonic() - start
            failures = sum(line["failed"] for line in runs[-1])
            print(
                f"seed {seed}: {len(runs[-1])} tests, {failures} failed, {seconds:.0f} s",
                flush=True,
            )
    return _print(runs)


def _read(path: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in path.read_text("utf-8").splitlines()]


def _print(runs: Sequence[Sequence[dict[str, Any]]]) -> int:
    rows = table(runs)
    short = [row for row in rows if row.falls_short]
    for row in short:
        if row.worst is None:
            seeds = ", ".join(map(str, row.failed_seeds))
            print(f"failed with VBAA_TEST_SEED = {seeds}: {row.test}")
        else:
            limit = f"{row.worst.low:.4g} < {row.worst.high:.4g}"
            print(f"{row.margin:6.1f}  {limit}  {row.where} {row.test.partition('::')[2]}")
    derived = {line["test"]: line["false_alarm"] for line in runs[0] if line["false_alarm"]}
    for test, (rate, derivation) in derived.items():
        print(f"  derived, {rate:g}: {derivation}  {test}")
    print(
        f"{len(rows)} assertions measured over {len(runs)} seeds; {len(short)} fall short of "
        f"{ENOUGH:g} standard deviations or failed."
    )
    return 1 if short else 0


if __name__ == "__main__":
    sys.exit(main())
