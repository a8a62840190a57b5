"""A scored run as one table of frames: what a baseline keeps, and how it pairs with another run."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import polars as pl

from solver.instrument.errors import InputError
from solver.instrument.hashes import digest, read_hashes
from vbaa_bench.dataset.collection import CollectionLayout, is_collection
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.readers import open_truth
from vbaa_bench.regression.compared import COMPARED
from vbaa_bench.scene.push import PushSpec
from vbaa_bench.scene.schema import Scene
from vbaa_bench.scoring.results_layout import Results
from vbaa_bench.scoring.score import read_scores, read_summary

# A frame's place in its scene: the rig of a collection, 0 for a dataset, and the trial.
PLACE: Final = ("rig", "trial")
# The true parameters by which paired frames are checked.
TEXTS: Final = ("push", "hidden_by", "hidden_place")
NUMBERS: Final = (
    "contact_distance_at_rest_mm",
    "normal_deg",
    "k_s_n_m",
    "availability_asked",
    "true_x_c_mm",
)
PARAMETERS: Final = (*TEXTS, *NUMBERS)
# The results of a method for a frame.
RESULTS: Final = ("outcome", *(quantity.column for quantity in COMPARED))
# Chosen: far above the six stored digits and the change of a contact by gravity at another motor
# angle, far below the distance of two trials.
_SAME: Final = 1e-3
_NEW: Final = "_new"
# Keys of a scene that do not change its experiment: its name, its random numbers, the sizes of the
# set and of its files, the layers that are kept.
_NOT_THE_EXPERIMENT: Final[dict[str, Any]] = {
    "title": True,
    "seed": True,
    "rigs": True,
    "splits": True,
    "layers": True,
    "frames_per_shard": True,
    "sampling": {"count"},
    "pushes": {"repeats"},
}


@dataclass(frozen=True)
class ScoredRun:
    """Scored run of one scene.

    `scene` has the keys in which the scene differs from the defaults; `images` is a sha256 of all
    images, equal if and only if two runs have solved the same ones. `frames` has one row for each
    method and frame: PLACE, `push_id`, PARAMETERS, `method` and RESULTS.
    """

    title: str
    scene: dict[str, Any]
    images: str
    processor: str
    frames: pl.DataFrame

    @property
    def methods(self) -> list[str]:
        """Names of the methods, in the order of the scores."""
        return self.frames["method"].unique(maintain_order=True).to_list()


def read_run(root: Path) -> ScoredRun:
    """Read a scored dataset or collection. Raises InputError if it is not scored, or damaged."""
    results = Results(root)
    scores = read_scores(results)
    if is_collection(root):
        layouts = CollectionLayout(root).rigs()
        scene = CollectionLayout(root).read_scene()
        title, settings = scene["title"], _without(scene, _NOT_THE_EXPERIMENT)
    else:
        layouts = {0: results.dataset}
        scores = scores.with_columns(rig=pl.lit(0))
        manifest = open_truth(results.dataset.truth, centrelines=False).manifest["scene"]
        title, settings = str(manifest["title"]), _settings(manifest)
    frames = scores.with_columns(pl.col("rig").cast(pl.Int64)).join(
        pl.concat(_trials(number, layout) for number, layout in layouts.items()),
        on=["rig", "frame_id"],
    )
    processor = str(read_summary(results)["machine"]["processor"])
    hashes = "".join(_image_hashes(layout) for layout in layouts.values())
    return ScoredRun(title, settings, digest(hashes.encode()), processor, _compact(frames))


def pair(old: ScoredRun, new: ScoredRun, path: Path) -> pl.DataFrame:
    """Pair the frames of a baseline, read from `path`, with those of a run, for each method.

    Frames are paired by rig, trial and method. Their true parameters must agree: texts exactly,
    numbers to 0.1 %. The parameters and `push_id` are those of the run; results of the baseline
    have their own names, and those of the run end with `_new`. Raises InputError if no frame is
    paired.
    """
    joined = old.frames.drop("push_id", strict=False).join(
        new.frames, on=[*PLACE, "method"], how="inner", suffix=_NEW, maintain_order="right"
    )
    scale = {name: pl.max_horizontal(pl.col(name).abs(), _new(name).abs()) for name in NUMBERS}
    same = [pl.col(name).eq_missing(_new(name)) for name in TEXTS]
    same += [
        (pl.col(name).is_null() & _new(name).is_null())
        | ((pl.col(name) - _new(name)).abs() <= _SAME * scale[name]).fill_null(value=False)
        for name in NUMBERS
    ]
    paired = joined.filter(pl.all_horizontal(same))
    if paired.is_empty():
        reason = "no common method" if joined.is_empty() else "other true parameters"
        raise InputError(f"{path}: no frame can be compared with the run ({reason})")
    return paired.select(
        *PLACE,
        "method",
        "push_id",
        *(_new(name).alias(name) for name in (*TEXTS, *NUMBERS)),
        *RESULTS,
        *(f"{name}{_NEW}" for name in RESULTS),
    )


def _new(name: str) -> pl.Expr:
    return pl.col(f"{name}{_NEW}")


def _settings(scene: dict[str, Any]) -> dict[str, Any]:
    """Reduce a manifest's scene to what differs from the defaults, which may gain keys."""
    pushes = PushSpec(contact_distance_mm=(1.0,), deflection_pct=(1.0,))
    tree = Scene(title="-", seed=0, pushes=pushes).model_dump(mode="json")
    return _without(_differences(scene, tree), _NOT_THE_EXPERIMENT)


def _differences(tree: dict[str, Any], defaults: dict[str, Any]) -> dict[str, Any]:
    different = {}
    for name, value in tree.items():
        default = defaults.get(name)
        if value != default:
            both = isinstance(value, dict) and isinstance(default, dict)
            different[name] = _differences(value, default or {}) if both else value
    return different


def _without(tree: dict[str, Any], excluded: dict[str, Any]) -> dict[str, Any]:
    kept = {name: value for name, value in tree.items() if excluded.get(name) is not True}
    for name, inner in excluded.items():
        if isinstance(inner, set) and isinstance(kept.get(name), dict):
            kept[name] = {key: value for key, value in kept[name].items() if key not in inner}
    return kept


def _trials(number: int, layout: Layout) -> pl.DataFrame:
    """Tabulate the trial of each frame of a rig, and the length of its beam."""
    truth = open_truth(layout.truth, centrelines=False)
    return truth.frames.select(
        pl.lit(number, pl.Int64).alias("rig"),
        "frame_id",
        "trial",
        pl.lit(truth.manifest["true_rig"]["beam_length_mm"]).alias("length_mm"),
    )


def _image_hashes(layout: Layout) -> str:
    """Join the sha256 of all images of a dataset, in the order of their names."""
    tree = layout.observations
    shards = sorted(tree.glob("shard_*"))
    tables = [read_hashes(tree) or {}, *(read_hashes(shard) or {} for shard in shards)]
    return "".join(
        table[name] for table in tables for name in sorted(table) if name.endswith(".png")
    )


def _compact(frames: pl.DataFrame) -> pl.DataFrame:
    """Select the compared values, rounded to four digits, and the true parameters to six."""
    if "reference_ms" not in frames.columns:  # runs of older versions
        frames = frames.with_columns(reference_ms=pl.lit(None, pl.Float64))
    return frames.select(
        *PLACE,
        "push_id",
        *TEXTS,
        *(pl.col(name).cast(pl.Float64).round_sig_figs(6) for name in NUMBERS),
        "method",
        "outcome",
        *(quantity.of_frames() for quantity in COMPARED),
    ).sort(*PLACE, maintain_order=True)
