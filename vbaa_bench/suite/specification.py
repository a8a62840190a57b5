"""A suite: one versioned file with its tracks, their datasets, metrics and rules."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final, NamedTuple

from pydantic import AfterValidator, Field, ValidationInfo, field_validator

from solver.instrument.errors import InputError, quoted
from solver.instrument.files import sha256
from solver.lab.protocol import MIN_LOADS, MIN_PLACES
from vbaa_bench.scene.frames import Frames
from vbaa_bench.scene.load import SceneFile, load_scene, read_model
from vbaa_bench.scene.part import Part
from vbaa_bench.scene.shipped import frozen_frames, shipped_scenes, shipped_suites
from vbaa_bench.scoring.isolation.runs import MAX_FRAME_S
from vbaa_bench.scoring.scored_quantities import CONSISTENT_SIGMAS
from vbaa_bench.scoring.statistics import FAILURE_ERROR_PCT_L
from vbaa_bench.suite.figures import ERROR, FIGURES

# Names of tracks and datasets, which are names of folders.
Name = Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9_]{0,39}$")]
Sentence = Annotated[str, Field(min_length=1)]
# Rules with one allowed value: the program applies it.
_APPLIED: Final = {
    "frame_limit_s": MAX_FRAME_S,
    "failure_error_pct": FAILURE_ERROR_PCT_L,
    "consistent_sigmas": CONSISTENT_SIGMAS,
    "min_loads": MIN_LOADS,
    "min_places": MIN_PLACES,
}


def _checked(value: float, info: ValidationInfo) -> float:
    """Refuse a rule that this program does not apply. Raises ValueError."""
    applied = _APPLIED[str(info.field_name)]
    if value != applied:
        raise ValueError(f"is {value:g}, allowed is {applied:g}, which this version applies")
    return value


_Applied = Annotated[float, AfterValidator(_checked)]


class Dataset(Part):
    """A dataset of a suite: a scene, and what is fixed of it."""

    scene: str = Field(description="Scene file, in the folder of the shipped scenes.")
    seed: int = Field(ge=0, description="Seed in place of the scene's own.")
    frames: int = Field(ge=1, description="Number of frames, of each rig if there are many.")
    rigs: int | None = Field(default=None, ge=1, description="Number of random rigs, the first.")
    set: tuple[str, ...] = Field(
        default=(), description="Values in place of the scene's, as `--set` takes them."
    )
    split: str | None = Field(default=None, description="Split that is scored; by default all.")


class Track(Part):
    """Datasets that are ranked together."""

    about: Sentence = Field(description="What the track measures, in one sentence.")
    datasets: Annotated[dict[Name, Dataset], Field(min_length=1)]


class Reference(Part):
    """The renderer's target on which the frozen frames were made."""

    variant: str
    target: str


class Rules(Part):
    """Rules of a suite; numbers are checked against those that this program applies."""

    reads: Sentence = Field(description="What a method may read.")
    frame_limit_s: _Applied = Field(description="Time limit of a frame, repeats included.")
    memory_gb: float = Field(ge=0, description="Memory limit of a method; 0: no limit.")
    repeats: int = Field(ge=1, description="Solutions per frame; the median time is used.")
    failure_error_pct: _Applied = Field(description="Error of a failure, in % of the length L.")
    consistent_sigmas: _Applied = Field(description="Largest consistent error, in stated sigmas.")
    refusals: Sentence = Field(description="How refusals count.")
    ties: Sentence = Field(description="When methods are not distinguished.")
    speed: Sentence = Field(description="Which times are ranked.")


class RealTrack(Part):
    """Track of the real sets of users, with the rules of docs/protocol.md that it applies."""

    about: Sentence = Field(description="What the track measures, in one sentence.")
    min_loads: _Applied = Field(description="Least number of pushes, and of hung weights.")
    min_places: _Applied = Field(description="Least number of places of each kind of load.")
    reads: Sentence = Field(description="What a method may read, and from what it may learn.")
    ranks: Sentence = Field(description="Why methods are not ranked.")


class Specification(Part):
    """Contents of the file of a suite."""

    version: Annotated[str, Field(pattern=r"^[0-9a-z][0-9a-z.]{0,19}$")]
    title: Sentence
    reference: Reference
    metrics: Annotated[tuple[str, ...], Field(min_length=1)]
    rules: Rules
    tracks: Annotated[dict[Name, Track], Field(min_length=1)]
    real: RealTrack | None = Field(
        default=None, description="Track of real sets; without it, none are scored."
    )

    @field_validator("metrics")
    @classmethod
    def _are_figures(cls, names: tuple[str, ...]) -> tuple[str, ...]:
        for name in names:
            if name not in FIGURES:
                allowed = ", ".join(FIGURES)
                raise ValueError(f"holds {quoted(name)}, allowed is one of {allowed}")
        if ERROR not in names:
            raise ValueError(f"holds no {ERROR}, by which methods are ranked")
        return names


class Entry(NamedTuple):
    """A dataset of a track, with the names of both."""

    track: str
    name: str
    dataset: Dataset

    @property
    def key(self) -> str:
        """Name of the dataset within the suite, such as `paper/fig8`."""
        return f"{self.track}/{self.name}"


@dataclass(frozen=True)
class Suite:
    """A suite and its file."""

    path: Path
    content: Specification

    @property
    def frozen(self) -> Path:
        """The file of the frozen frames, beside that of the suite."""
        return frozen_frames(self.path)

    @property
    def sha256(self) -> str:
        """Digest of the suite's file, by which two versions are distinguished."""
        return sha256(self.path)

    def entries(self, tracks: tuple[str, ...] = ()) -> list[Entry]:
        """List the datasets of these tracks, or of all. Raises InputError for an unknown one."""
        for name in tracks:
            if name not in self.content.tracks:
                raise InputError(
                    f"track {quoted(name)} is unknown, allowed is one of "
                    f"{', '.join(self.content.tracks)}"
                )
        return [
            Entry(name, dataset, specification)
            for name, track in self.content.tracks.items()
            if name in (tracks or self.content.tracks)
            for dataset, specification in track.datasets.items()
        ]

    def scene(self, entry: Entry, seed: int | None = None) -> SceneFile:
        """Load the scene of a dataset, with another seed for a fresh one.

        Raises InputError if it has another number of frames or of rigs than the suite states.
        """
        dataset = entry.dataset
        chosen = dataset.seed if seed is None else seed
        file = load_scene(shipped_scenes() / dataset.scene, chosen, dataset.set)
        frames = Frames(file.scene).count
        if frames != dataset.frames:
            raise self._mistake(
                entry, "frames", dataset.frames, f"{frames}, the number of {dataset.scene}"
            )
        if (file.rigs is None) != (dataset.rigs is None) or (dataset.rigs or 0) > (file.rigs or 0):
            allowed = "nothing" if file.rigs is None else f"a number up to {file.rigs}"
            raise self._mistake(entry, "rigs", dataset.rigs, f"{allowed}, as in {dataset.scene}")
        return file

    def _mistake(self, entry: Entry, key: str, value: object, allowed: str) -> InputError:
        place = f"tracks.{entry.track}.datasets.{entry.name}.{key}"
        return InputError(f"{self.path}: {place} is {value}, allowed is {allowed}")


def load_suite(name: str) -> Suite:
    """Read a shipped suite by its version, or one from a file that ends in .yaml.

    Raises InputError with all mistakes.
    """
    shipped = {path.stem: path for path in shipped_suites()}
    if not name.endswith(".yaml") and name not in shipped:
        raise InputError(
            f"suite {quoted(name)} is unknown, allowed is {', '.join(shipped)} or a file .yaml"
        )
    path = Path(name) if name.endswith(".yaml") else shipped[name]
    suite = Suite(path, read_model(path, Specification))
    if path.stem != suite.content.version:
        raise InputError(
            f"{path}: version is {suite.content.version}, allowed is the file name {path.stem}"
        )
    return suite
