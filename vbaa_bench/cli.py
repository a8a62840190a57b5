"""`vbaa-bench`: run (generate, solve, score, report), table, contact-sheet, speed, doctor."""

import sys
from itertools import product
from pathlib import Path
from typing import Annotated, Any

from vbaa_bench.interrupt import raise_again  # isort: skip  # first: Ctrl-C while importing

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from solver.instrument.errors import InputError
from solver.instrument.observation import open_observations
from solver.lab.writing import make_room
from solver.lab.writing import write as write_file
from solver.methods import METHODS
from vbaa_bench.checks import doctor as checks
from vbaa_bench.console import (
    console,
    hear,
    outcomes,
    progress_bars,
    say,
    show_scores,
    show_table,
)
from vbaa_bench.options import (
    AsJson,
    Centreline,
    DatasetPath,
    Memory,
    Method,
    Out,
    Picture,
    Predictions,
    Repeats,
    ScenePath,
    Seed,
    Variant,
    Workers,
)
from vbaa_bench.render.variant import ADVICE, PLAIN, choose
from vbaa_bench.scoring.accuracy import accuracy, markdown
from vbaa_bench.scoring.applicable import applicable
from vbaa_bench.scoring.child import MEMORY_GB, MethodRun
from vbaa_bench.scoring.child import solve as solve_apart
from vbaa_bench.scoring.layout import USUAL_CENTRELINE, Results, kept_as
from vbaa_bench.scoring.metrics import CONDITIONS
from vbaa_bench.scoring.score import score as score_predictions
from vbaa_bench.scoring.score import with_own
from vbaa_bench.spec.load import load_scene
from vbaa_bench.speed import speed_app
from vbaa_bench.workers import WorkerDiedError, cores

# What `--method` understands beside names of methods.
ALL = "all"

app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help="Render a vision-based active antenna, solve it, and see speed against error.",
)
app.add_typer(speed_app, name="speed")


@app.command()
def run(
    scene: ScenePath,
    out: Out = None,
    method: Method = None,
    centreline: Centreline = None,
    seed: Seed = None,
    workers: Workers = None,
    variant: Variant = None,
    repeats: Repeats = 3,
    memory: Memory = MEMORY_GB,
    as_json: AsJson = False,
) -> None:
    """Generate, solve, score and report a scene."""
    results = Results(_generate(scene, out, seed, workers, variant))
    solved = _solve(results, method, centreline, repeats, memory)
    written = {name: one.table for name, one in solved.items()}
    summary = score_predictions(results, written)
    _warn(summary)
    page = _report(results)
    show_scores(summary, {"report": str(page), **summary}, as_json)
    if not as_json:
        for name, path in written.items():
            if summary["methods"][name]["failure_rate"] == 1:
                console.print(f"{name} answers no frame: {outcomes(path)}", markup=False)
        Console(soft_wrap=True).print(f"report: {page}", highlight=False, markup=False)
    _fail_where_all_crashed(solved)


@app.command()
def generate(
    scene: ScenePath,
    out: Out = None,
    seed: Seed = None,
    workers: Workers = None,
    variant: Variant = None,
    as_json: AsJson = False,
) -> None:
    """Render a scene into a dataset. Interrupted, the same command finishes it."""
    root = _generate(scene, out, seed, workers, variant)
    frames = len(list(root.glob("observations/shard_*/*.png")))
    say({"dataset": str(root), "frames": frames}, f"{frames} frames in {root}", as_json)


@app.command()
def solve(
    dataset: DatasetPath,
    method: Method = None,
    centreline: Centreline = None,
    repeats: Repeats = 3,
    memory: Memory = MEMORY_GB,
    as_json: AsJson = False,
) -> None:
    """Run methods on a dataset's observations, each in a process that never sees the truth."""
    results = Results(dataset)
    solved = _solve(results, method, centreline, repeats, memory)
    record = {"predictions": {name: str(one.table) for name, one in solved.items()}}
    lines = [f"{one.table}: {outcomes(one.table)}" for one in solved.values()]
    say(record, "\n".join(lines), as_json)
    _fail_where_all_crashed(solved)


@app.command()
def score(dataset: DatasetPath, predictions: Predictions = None, as_json: AsJson = False) -> None:
    """Score all solved methods, and predictions files of one's own beside them, which are kept."""
    results = Results(dataset)
    summary = score_predictions(results, with_own(results, predictions or []))
    _warn(summary)
    show_scores(summary, summary, as_json)


@app.command()
def report(dataset: DatasetPath, as_json: AsJson = False) -> None:
    """Write the HTML report of a scored dataset."""
    page = _report(Results(dataset))
    say({"report": str(page)}, str(page), as_json)


@app.command()
def table(
    datasets: Annotated[list[Path], typer.Argument(help="folders of scored datasets")],
    by: Annotated[
        str | None, typer.Option(help=f"a row for each value of one of {', '.join(CONDITIONS)}")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Print the scores of several datasets as one Markdown table, remarks below."""
    rows = accuracy(datasets, by)
    if as_json:
        say({"rows": rows}, "", True)
    else:
        print(markdown(rows, by))


@app.command("contact-sheet")
def contact_sheet(
    scenes: Annotated[Path, typer.Argument(help="a folder of scenes")] = Path("scenes"),
    out: Picture = None,
    lights: Annotated[
        bool, typer.Option("--lights", help="SCENES/lighting, by materials and backgrounds")
    ] = False,
    variant: Variant = None,
    as_json: AsJson = False,
) -> None:
    """Render one frame of every scene in a folder onto one picture."""
    # Imported late: doctor must run where the renderer cannot even be loaded.
    from vbaa_bench.report.contact_sheet import contact_sheet as write_sheet
    from vbaa_bench.report.lighting_sheet import lighting_sheet

    found = sorted(scenes.rglob("*.yaml"))
    out = out or Path("results/lighting.png" if lights else "results/scenes.png")
    if lights:
        found, write_sheet = sorted((scenes / "lighting").glob("*.yaml")), lighting_sheet
    if not found:
        raise InputError(f"{scenes}: holds no scene, *.yaml")
    with progress_bars() as progress:
        task = progress.add_task("scenes", total=len(found))
        write_sheet(found, out, choose(variant), lambda n, _: progress.update(task, completed=n))
    say({"picture": str(out), "scenes": len(found)}, str(out), as_json)


@app.command("check-camera")
def check_camera(scene: ScenePath, variant: Variant = None, as_json: AsJson = False) -> None:
    """Calibrate from a scene's rendered calibration images, and compare with the true camera."""
    # Imported late: doctor must run where the renderer cannot even be loaded.
    from vbaa_bench.checks import check_camera as camera

    file, chosen = load_scene(scene), choose(variant)
    with progress_bars() as progress:
        task = progress.add_task("calibration images", total=None)
        tested, found = camera.check_camera(
            file, chosen, lambda done, total: progress.update(task, completed=done, total=total)
        )
    record = camera.record(tested, found)
    if as_json:
        say(record, "", True)
    else:
        shown = Table("quantity", "error", "allowed", "passes")
        for one in tested:
            row = f"{one.error:.3g} {one.unit}", f"{one.allowed:g} {one.unit}"
            shown.add_row(one.quantity, *row, "yes" if one.passed else "no")
        Console().print(shown)
    if not record["passed"]:
        raise typer.Exit(1)


@app.command()
def stability(as_json: AsJson = False) -> None:
    """What every method makes of noise and of rounding in its points, and how well it is posed."""
    # Imported late: no other command needs the methods' compiler here.
    from vbaa_bench.checks import stability as methods

    with console.status("perturbing points"):
        record = methods.measure()
    if as_json:
        say(record, "", True)
        return
    contacts = sorted({case["contact"] for case in record["methods"]["exact_fit"]})
    places = ", ".join(f"{contact:g}" for contact in contacts)
    show_table(
        f"per pixel of noise, for contacts at x_c / L = {places}; condition; rounding",
        ("method", "deflection", "x_c, % of L", "force, %", "condition", "x_c / L by 1 ulp"),
        methods.rows(record),
    )


@app.command()
def stress(
    scene: ScenePath,
    rigs: Annotated[int, typer.Option(min=1, max=10_000, help="drawn rigs")] = 30,
    frames: Annotated[int, typer.Option(min=1, max=10_000, help="frames of each rig")] = 10,
    seed: Annotated[int, typer.Option(min=0, help="draws other rigs")] = 1,
    row: Annotated[
        list[str] | None, typer.Option(help="a row of the table; repeatable", show_default="all")
    ] = None,
    method: Annotated[str, typer.Option(help=", ".join(METHODS))] = "exact_fit",
    work: Annotated[
        Path | None,
        typer.Option(help="folder of the rigs' datasets", show_default="runs/stress/<scene>"),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="JSON to write, with the result of every frame")
    ] = None,
    workers: Workers = None,
    variant: Variant = None,
    as_json: AsJson = False,
) -> None:
    """Perturb the images of drawn rigs as ordinary cameras and laboratories do, and solve them.

    Exit status 1 if a wanted figure is not reached. Rendered rigs are kept and used again.
    """
    # Imported late: doctor must run where the renderer cannot even be loaded.
    from vbaa_bench.checks.stress import command
    from vbaa_bench.checks.stress.run import HEADS, TITLE, lines

    if out:
        make_room(out)
    plan = command.Plan(load_scene(scene), rigs, frames, seed, row or (), method)
    folder = work or Path("runs/stress") / scene.stem
    count = workers or cores()
    with progress_bars() as progress:
        bars = {name: progress.add_task(name, total=None) for name in ("rendering", "solving")}
        try:
            record = command.stress(
                plan,
                folder,
                choose(variant),
                count,
                lambda name, done, total: progress.update(bars[name], completed=done, total=total),
            )
        except KeyboardInterrupt:
            console.print("interrupted; the same command uses the rigs that are rendered")
            raise
    if out:
        write_file(out, command.text(record).encode())
    if as_json:
        say(command.without_frames(record), "", True)
    else:
        title = f"{record['scene']}: {rigs} rigs x {frames} frames\n{TITLE}"
        show_table(title, HEADS, lines(record["rows"]))
    if not record["holds"]:
        raise typer.Exit(1)


@app.command()
def doctor(
    install: Annotated[
        bool, typer.Option("--install", help="install missing libraries by apt, as root")
    ] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="one line")] = False,
    as_json: AsJson = False,
) -> None:
    """Say what this machine can render with, and what to install."""
    if install:
        console.print(checks.install_libraries())
        if quiet:
            return
    found = checks.diagnose()
    shown = Table("variant", "works", "said")
    for probe in found.probes:
        shown.add_row(probe.variant, "yes" if probe.works else "no", probe.said)
    if as_json:
        say(found.record(), "", True)
    else:
        if not quiet:
            Console().print(shown)
        console.print(found.advice)
    if not found.healthy:
        raise typer.Exit(1)


def _generate(
    scene: Path, out: Path | None, seed: int | None, workers: int | None, variant: str | None
) -> Path:
    # Imported late: doctor must run where the renderer cannot even be loaded.
    from vbaa_bench.generation import generate as generate_dataset

    file = load_scene(scene, seed)
    chosen = choose(variant)
    if chosen == PLAIN and variant is None:
        console.print(f"rendering with scalar_rgb, about ten times slower: {ADVICE}")
    root = out or Path("runs") / scene.stem
    # Without wavefronts Mitsuba's own threads fill the machine better than processes do.
    count = workers or (1 if chosen == PLAIN else cores())
    with progress_bars() as progress:
        solved = progress.add_task("mechanics", total=None)
        task = progress.add_task("rendering", total=None, visible=False)
        try:
            generate_dataset(
                file,
                root,
                chosen,
                count,
                lambda done, total: progress.update(
                    task, completed=done, total=total, visible=True
                ),
                lambda done, total: progress.update(solved, completed=done, total=total),
                lambda sentence: console.print(sentence, markup=False),
            )
        except KeyboardInterrupt:
            console.print("interrupted; the same command goes on from what is finished")
            raise
    return root


def _report(results: Results) -> Path:
    # Imported late: the plotting libraries take a second that no other command needs.
    from vbaa_bench.report.report import report as write_report

    return write_report(results)


def _solve(
    results: Results,
    methods: list[str] | None,
    centrelines: list[str] | None,
    repeats: int,
    memory: float,
) -> dict[str, MethodRun]:
    solved = {}
    asked = methods or applicable(open_observations(results.dataset.observations))
    chosen = dict.fromkeys(one for name in asked for one in (METHODS if name == ALL else [name]))
    for method, centreline in product(chosen, dict.fromkeys(centrelines or [USUAL_CENTRELINE])):
        name = kept_as(method, centreline)
        target = results.predictions / f"{name}.csv"
        with console.status(escape(f"solving with {name}")):
            solved[name] = solve_apart(
                results.dataset, method, target, repeats, centreline, memory_gb=memory, hear=hear
            )
        if solved[name].traceback:
            hear(f"{name}, the first of {solved[name].crashed} crashes:\n{solved[name].traceback}")
    return solved


def _warn(summary: dict[str, Any]) -> None:
    for warning in summary["warnings"]:
        hear(f"warning: {warning}")


def _fail_where_all_crashed(solved: dict[str, MethodRun]) -> None:
    """Exit with status 1 if a method crashed on every frame."""
    if any(one.crashed == one.frames for one in solved.values()):
        raise typer.Exit(1)


def main() -> None:
    """Run; a mistake in the input is a clear sentence and exit status 2, Ctrl-C is status 130."""
    try:
        app()
    except KeyboardInterrupt:
        sys.exit(130)
    except InputError as error:
        Console(stderr=True, highlight=False, soft_wrap=True).print(f"error: {error}", markup=False)
        sys.exit(2)
    except WorkerDiedError as error:
        console.print(f"error: {error}", markup=False)
        sys.exit(1)


raise_again()
