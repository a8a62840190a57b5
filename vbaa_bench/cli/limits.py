"""The command limits: of a scene as maps, or of the frames of a dataset."""

from pathlib import Path
from typing import Annotated

import typer

from vbaa_bench.cli.interrupt import importing
from vbaa_bench.cli.options import AsJson, Modules, SceneOrDataset, Seed, Settings, Variant, Workers
from vbaa_bench.report.console import (
    console,
    print_line,
    print_result,
    progress_bar,
    progress_bars,
    show_table,
)


def limits(
    source: SceneOrDataset,
    vary: Annotated[
        list[str] | None,
        typer.Option(
            help="values to compare: beam.diameter_mm=0.4,0.8; of keys that change together: "
            "camera.width_px+camera.height_px=256,512 or =256+192,512+384; repeatable"
        ),
    ] = None,
    require: Annotated[
        list[str] | None,
        typer.Option(help="largest standard deviations: x_c_pct_L=0.1,force_mn=1; repeatable"),
    ] = None,
    information: Annotated[
        str, typer.Option(help="data that a method uses: planar, image, moment, force or push")
    ] = "image",
    # Chosen: six columns fit a telephone; deflections from hardly visible to large.
    contact_distances: Annotated[
        str, typer.Option("--contact-distance-pct", help="contact distances [% of L]")
    ] = "15,30,45,60,75,90",
    deflections: Annotated[
        str, typer.Option("--deflection-pct", help="deflections of the tip [% of L]")
    ] = "1,2,5,10,20,30",
    seed: Seed = None,
    settings: Settings = None,
    _module: Modules = None,
    out: Annotated[
        Path | None,
        typer.Option(help="HTML page to write", show_default="runs/limits/<scene>.html"),
    ] = None,
    csv: Annotated[Path | None, typer.Option(help="CSV file to write, one row per place")] = None,
    workers: Workers = None,
    variant: Variant = None,
    as_json: AsJson = False,
) -> None:
    """Compute information limits: of a scene as maps, without rendering; or of a dataset.

    A limit is the smallest standard deviation that a method without bias can have (Cramer, Rao).
    Those of a dataset or collection are stored in it, for `score` and `report`.
    """
    with importing():
        from solver.instrument.errors import InputError

    if source.is_dir():
        if vary or require or settings or out or csv or seed is not None:
            raise InputError(
                f"{source}: is a dataset, so that only --workers and --variant are allowed"
            )
        frames = store_limits(source, workers, variant)
        sentence = f"limits of {frames} frames, in {source}"
        print_result({"dataset": str(source), "frames": frames}, sentence, as_json)
        return

    with importing():
        from solver.lab.writing import prepare_output_path, write
        from vbaa_bench.api.data import usable_variant, worker_count
        from vbaa_bench.limits import designs, maps, places, requirements, summaries
        from vbaa_bench.limits.page import limits_page
        from vbaa_bench.limits.summary_table import answers, summary_table
        from vbaa_bench.scene.load import load_scene
        from vbaa_bench.scoring.information_sets import SETS, check_information

    check_information(information, "--information")
    required = requirements.requirements(require or [], information)
    grid = places.grid(
        _numbers("--contact-distance-pct", contact_distances),
        _numbers("--deflection-pct", deflections),
    )
    # A mistake in the file or in --set is not one of a design.
    file = load_scene(source, seed, settings or ())
    page = out or Path("runs/limits") / f"{source.stem}.html"
    for path in filter(None, (page, csv)):
        prepare_output_path(path)
    with console.status("checking the designs"):
        compared = designs.designs(source, vary or (), information, seed, settings or ())
        chosen = usable_variant(variant)
    with progress_bars() as bars:
        table = maps.maps(
            compared,
            grid,
            information,
            chosen,
            worker_count(workers, chosen),
            progress_bar(bars, "limits"),
        )
    summary = summaries.summaries(table, compared, required)
    facts = [f"Information set {information}: {SETS[information]}, with all data before contact."]
    if information == "push":
        facts.append("The steps of a push are the deflections of the map, up to that of the place.")
    facts += [f"Changed in the scene: {', '.join(settings)}."] if settings else []
    facts += ["Random keys have the values of their first draw."] if file.is_random else []
    title = f"Information limits: {file.scene.title}"
    write(page, limits_page(title, facts, table, summary, required, information).encode())
    if csv:
        write(csv, table.write_csv().encode())
    if as_json:
        record = {
            "scene": str(source),
            "information": information,
            "requirements": [str(one) for one in required],
            "designs": [one.record() for one in summary],
            "places": table.to_dicts(),
            "page": str(page),
        }
        print_result(record, "", True)
        return
    show_table(f"{title}\nmedian (best–worst) over places", *summary_table(summary, required))
    for line in [*facts, *(f"{one.design}: {one.reason}" for one in summary if one.reason)]:
        print_line(line)
    print_result({}, "\n".join([*answers(summary, required), f"page: {page}"]), False)


def store_limits(root: Path, workers: int | None, variant: str | None) -> int:
    """Compute and store the limits of a dataset or collection; return their number of frames."""
    with importing():
        from vbaa_bench.api.data import usable_variant, worker_count
        from vbaa_bench.dataset.collection import CollectionLayout, is_collection
        from vbaa_bench.limits.dataset_limits import dataset_limits

    rigs = CollectionLayout(root).rigs() if is_collection(root) else {}
    roots = [layout.root for layout in rigs.values()] or [root]
    chosen, frames = usable_variant(variant), 0
    count = worker_count(workers, chosen)
    with progress_bars() as bars:
        of_rigs = bars.add_task("rigs", total=len(roots), visible=len(roots) > 1)
        bar = progress_bar(bars, "limits")
        for one in roots:
            table = dataset_limits(one, chosen, count, bar)
            frames += table["frame_id"].n_unique()
            bars.advance(of_rigs)
    return frames


def _numbers(name: str, text: str) -> list[float]:
    """Parse numbers that are separated by commas. Raises InputError."""
    from solver.instrument.errors import InputError, quoted

    try:
        return [float(part) for part in text.split(",")]
    except ValueError as error:
        raise InputError(f"{name} is {quoted(text)}, allowed are numbers such as 10,20") from error
