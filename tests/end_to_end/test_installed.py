"""The package as it is installed: contents of wheel and sdist; what runs in an empty environment.

The environments have a package and what it requires, and nothing else: links to what is installed
here, so that no network is needed.
"""

import json
import subprocess
import sys
import tarfile
import tomllib
import venv
import zipfile
from collections.abc import Iterator
from importlib.metadata import Distribution, distribution
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from vbaa_bench.extra import MODULES

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def build(source: Path, out: Path, *targets: str) -> list[Path]:
    """Build targets of a source tree; return the files in `out`."""
    words = [word for target in targets for word in ("-t", target)]
    command = [sys.executable, "-m", "hatchling", "build", "-d", str(out), *words]
    done = subprocess.run(command, cwd=source, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return sorted(out.iterdir())


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """The wheel and the sdist of this checkout."""
    wheel, sdist = build(ROOT, tmp_path_factory.mktemp("dist"), "wheel", "sdist")
    return wheel, sdist


def requirements(package: Distribution, extra: str) -> Iterator[str]:
    """Yield the names of all packages that a package with an extra needs, also indirectly."""
    for line in package.requires or []:
        requirement = Requirement(line)
        if requirement.marker is None or requirement.marker.evaluate({"extra": extra}):
            yield canonicalize_name(requirement.name)
            yield from requirements(distribution(requirement.name), "")


def environment(folder: Path, wheel: Path, extra: str) -> Path:
    """Make an environment with the wheel and what it requires; return its Python."""
    venv.create(folder, symlinks=True)
    (site,) = folder.glob("lib/python*/site-packages")
    zipfile.ZipFile(wheel).extractall(site)
    package = Distribution.at(next(site.glob("*.dist-info")))
    for name in sorted(set(requirements(package, extra)) - {"vbaa-bench"}):
        installed = distribution(name)
        tops = {file.parts[0] for file in installed.files or [] if file.parts[0] != ".."}
        for top in tops - {"__pycache__"}:
            if not (site / top).exists():
                (site / top).symlink_to(str(installed.locate_file(top)))
    return folder / "bin/python"


def run(python: Path, *words: str) -> subprocess.CompletedProcess[str]:
    # -P: the package is that of the environment, not of the current folder.
    command = [str(python), "-P", "-m", *words]
    folder = python.parents[1]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


def test_the_extra_has_the_modules_that_a_missing_one_is_named_by() -> None:
    listed = [Requirement(line).name for line in PROJECT["optional-dependencies"]["bench"]]
    tops = [
        {file.parts[0].partition(".")[0] for file in distribution(name).files or []}
        for name in listed
    ]
    assert sum(map(len, (modules & set(MODULES) for modules in tops))) == len(MODULES)
    assert all(modules & set(MODULES) for modules in tops)


@pytest.mark.thorough
def test_wheel_and_sdist_are_complete(built: tuple[Path, Path], tmp_path: Path) -> None:
    wheel, sdist = built
    names = set(zipfile.ZipFile(wheel).namelist())
    for folder, target in (("solver", ""), ("vbaa_bench", ""), ("scenes", "vbaa_bench/")):
        files = [path for path in (ROOT / folder).rglob("*") if path.is_file()]
        files = [path for path in files if "__pycache__" not in path.parts]
        assert {target + path.relative_to(ROOT).as_posix() for path in files} <= names
    tops = {name.partition("/")[0] for name in names}
    assert tops == {"solver", "vbaa_bench", f"vbaa_bench-{PROJECT['version']}.dist-info"}
    with tarfile.open(sdist) as archive:
        # Python 3.11 has the filter from 3.11.4 on.
        archive.extraction_filter = getattr(tarfile, "data_filter", None)
        archive.extractall(tmp_path)
    (again,) = build(next(tmp_path.iterdir()), tmp_path / "dist", "wheel")
    assert set(zipfile.ZipFile(again).namelist()) == names


@pytest.mark.thorough
def test_the_antenna_is_installed_alone(built: tuple[Path, Path], tmp_path: Path) -> None:
    python = environment(tmp_path, built[0], "")
    assert run(python, "solver", "--help").returncode == 0
    assert "quickstart" in run(python, "vbaa_bench", "scenes").stdout
    for words in (["run", "quickstart"], ["doctor"], ["schema", "columns"]):
        done = run(python, "vbaa_bench", *words)
        assert done.returncode == 2
        assert done.stderr.endswith("adds renderer and scores\n")
        assert "Traceback" not in done.stderr


@pytest.mark.thorough
def test_the_benchmark_is_installed_without_a_checkout(
    built: tuple[Path, Path], tmp_path: Path
) -> None:
    python = environment(tmp_path, built[0], "bench")
    listed = json.loads(run(python, "vbaa_bench", "scenes", "--json").stdout)["scenes"]
    assert all(Path(scene["file"]).is_relative_to(tmp_path) for scene in listed)
    assert run(python, "vbaa_bench", "schema", "scene").returncode == 0
    place = ("--contact-distance-pct", "50", "--deflection-pct", "10", "--workers", "1")
    done = run(python, "vbaa_bench", "limits", "quickstart", *place, "--json")
    assert done.returncode == 0, done.stderr
    (only,) = json.loads(done.stdout)["places"]
    assert 0 < only["x_c_limit_pct_L"] < 1
