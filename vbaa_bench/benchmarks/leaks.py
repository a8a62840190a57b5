"""Search for leaks: do names, order, image files or the encoder predict the contact distance?

A method should estimate the contact from the beam's shape. Everything else that it can read, from
the order of the files to the metadata of an image, must be as good as random. Each feature is given
to two regressors, whose held-out R^2 is compared with that of permuted labels.
"""

import itertools
import math
import struct
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial.distance import cdist

from solver.instrument.arrays import Floats
from solver.instrument.errors import InputError
from solver.instrument.hashes import read_bytes
from solver.instrument.image_frame import ImageFrame
from solver.instrument.images import read_grey
from solver.instrument.observation import open_observations
from solver.instrument.units import DEGREE
from vbaa_bench.dataset.collection import CollectionLayout, is_collection
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.readers import open_truth

Ints = npt.NDArray[np.int64]

FOLDS: Final = 5
PERMUTATIONS: Final = 200
# One clean feature in a hundred exceeds this percentile by chance.
PERCENTILE: Final = 99.0
# Pushes of a dataset, or rigs of a collection. Chosen: four per fold; with fewer, permuted labels
# have a large R^2 and only gross leaks are found.
MIN_GROUPS: Final = 20
# Chosen: this number reveals a leak of R^2 = 0.5 %; memory grows with its square.
MAX_FRAMES: Final = 3000
# Ridge penalty over the number of training frames, for features of unit variance. Chosen: it takes
# a tenth off the slope of a leak, and keeps the coefficients of 80 random digits small.
_RIDGE: Final = 0.1
# Low bits of a number. The leading digits of a Sobol point depend on the low bits of its number.
_BITS: Final = 6
_CRITICAL: Final = frozenset({"IHDR", "IDAT", "IEND"})


@dataclass(frozen=True)
class ImageFacts:
    """What the files of a frame reveal without its pixels, and the gray values of its rig.

    `chunks` are types and lengths of the PNG's chunks except the image data. `exposure` holds the
    mean gray values of the rest images and of the first calibration image.
    """

    width: int
    height: int
    bits: int
    chunks: tuple[tuple[str, int], ...]
    exposure: tuple[float, float]


@dataclass(frozen=True)
class LeakFrame:
    """One frame: its label, contact distance over beam length, and what might reveal it.

    `position` is its row in the metadata.csv of its shard. `motor_angle` [rad] is None without an
    encoder, `image` is None if nothing was rendered.
    """

    x_c_over_length: float
    rig: int
    shard: int
    position: int
    frame_id: str
    push_id: str
    motor_angle: float | None = None
    image: ImageFacts | None = None


class LeakTest(NamedTuple):
    """Result for one feature: held-out R^2, and its 99th percentile with permuted labels."""

    feature: str
    frames: int
    r_squared: float
    chance: float

    @property
    def passes(self) -> bool:
        """Whether the feature is no better than chance; a constant feature has R^2 = 0."""
        return self.r_squared < self.chance or self.r_squared <= 0

    def record(self) -> dict[str, Any]:
        """Collect the result for JSON output."""
        return {**self._asdict(), "passes": self.passes}


def find_leaks(root: Path) -> list[LeakTest]:
    """Test all features of a dataset or a collection. Raises InputError."""
    layouts = CollectionLayout(root).rigs() if is_collection(root) else {0: Layout(root)}
    rigs = [list(_frames(number, layout)) for number, layout in layouts.items()]
    frames = list(itertools.chain.from_iterable(rigs))
    if len(frames) > MAX_FRAMES:
        chosen = np.random.default_rng(0).choice(len(frames), MAX_FRAMES, replace=False)
        frames = [frames[i] for i in np.sort(chosen)]
    groups = len(set(_groups(frames).tolist()))
    if groups < MIN_GROUPS:
        kind = "complete rigs with contact" if is_collection(root) else "pushes with contact"
        raise InputError(f"{root}: has {groups} {kind}, allowed is >= {MIN_GROUPS}")
    return leak_tests([replace(frame, image=image) for frame, image in _images(layouts, frames)])


def leak_tests(frames: Sequence[LeakFrame], seed: int = 0) -> list[LeakTest]:
    """Test each feature that some of the frames have.

    R^2 is the larger one of k nearest neighbours and of ridge regression, by 5-fold
    cross-validation. Whole pushes are held out, whole rigs if there are several: frames of one
    push share its contact, and this is no leak. Labels are permuted in the same blocks: rigs,
    pushes within a rig, frames within a push.
    """
    tests = []
    for name, values in features(frames).items():
        known = np.asarray(np.isfinite(values).all(axis=1))
        chosen = list(itertools.compress(frames, known))
        if len(set(_groups(chosen).tolist())) >= MIN_GROUPS:
            tests.append(_leak_test(name, values[known], chosen, np.random.default_rng(seed)))
    return tests


def features(frames: Sequence[LeakFrame]) -> dict[str, Floats]:
    """Collect the features of frames by name, each (frames, numbers); NaN where there is none."""
    pushes = Counter((frame.rig, frame.push_id) for frame in frames)
    chunks = sorted({frame.image.chunks for frame in frames if frame.image is not None})
    kinds = {layout: number for number, layout in enumerate(chunks)}
    rows: dict[str, list[Iterable[float]]] = {
        "order of the files": [
            value
            for frame in frames
            for value in [(*_number(frame.shard), *_number(frame.position), *_number(frame.rig))]
        ],
        "frame_id": [_digits(frame.frame_id) for frame in frames],
        "push_id": [_digits(frame.push_id) for frame in frames],
        "image size": [
            (math.nan,) * 3 if image is None else (image.width, image.height, image.bits)
            for image in (frame.image for frame in frames)
        ],
        "exposure": [
            (math.nan,) * 2 if image is None else image.exposure
            for image in (frame.image for frame in frames)
        ],
        "PNG metadata": [
            (math.nan,) * (len(kinds) + 2)
            if image is None
            else (
                len(image.chunks),
                sum(length for _, length in image.chunks),
                *(float(kinds[image.chunks] == kind) for kind in range(len(kinds))),
            )
            for image in (frame.image for frame in frames)
        ],
        "encoder, pushes of one frame": [
            (math.nan if angle is None or pushes[frame.rig, frame.push_id] > 1 else angle / DEGREE,)
            for frame in frames
            for angle in [frame.motor_angle]
        ],
    }
    return {name: np.array(values, dtype=float) for name, values in rows.items()}


def png_chunks(data: bytes) -> tuple[tuple[str, int], ...]:
    """List type and length of a PNG's chunks in their order, without the image data.

    The image data (IDAT), whose size depends on the picture, are one entry of length 0 however
    many chunks they have. Raises ValueError if the file is truncated.
    """
    chunks, start = list[tuple[str, int]](), 8
    while start < len(data):
        if start + 12 > len(data):
            raise ValueError("the PNG file ends within a chunk")
        (length,) = struct.unpack(">I", data[start : start + 4])
        kind = data[start + 4 : start + 8].decode("latin-1")
        entry = (kind, 0 if kind in _CRITICAL else length)
        if not (kind == "IDAT" and chunks and chunks[-1] == entry):
            chunks.append(entry)
        start += 12 + length
    return tuple(chunks)


def _number(number: int) -> tuple[float, ...]:
    return (float(number), *(float(number >> bit & 1) for bit in range(_BITS)))


def _digits(name: str) -> tuple[float, ...]:
    """Convert an opaque name to its value as a fraction of 1, and to its hexadecimal digits."""
    return (int(name, 16) / 16 ** len(name), *(float(int(digit, 16)) for digit in name))


def _frames(rig: int, layout: Layout) -> Iterator[LeakFrame]:
    """Yield the frames of a dataset that have a contact, in the order of their files."""
    truth = open_truth(layout.truth)
    length = truth.manifest["true_rig"]["beam_length_mm"]
    x_c = dict(truth.frames.select("frame_id", "x_c_mm").iter_rows())
    position = Counter[int]()
    for frame in open_observations(layout.observations).frames:
        shard = _shard(frame)
        if x_c[frame.frame_id] is not None:
            yield LeakFrame(
                x_c[frame.frame_id] / length,
                rig,
                shard,
                position[shard],
                frame.frame_id,
                frame.push_id,
                frame.readings.motor_angle,
            )
        position[shard] += 1


def _shard(frame: ImageFrame) -> int:
    return int(frame.path.parent.name.rpartition("_")[2])


def _images(
    layouts: Mapping[int, Layout], frames: Sequence[LeakFrame]
) -> Iterator[tuple[LeakFrame, ImageFacts]]:
    """Read the image files of frames, which are sorted by rig."""
    for rig, of_rig in itertools.groupby(frames, key=lambda frame: frame.rig):
        layout = layouts[rig]
        opened = open_observations(layout.observations)
        rest = float(np.mean([image.mean() for image in opened.read_rest_images()]))
        exposure = (rest, float(read_grey(opened.board_views[0]).mean()))
        for frame in of_rig:
            path = layout.shard(layout.observations, frame.shard) / f"{frame.frame_id}.png"
            yield frame, _image_facts(path, exposure)


def _image_facts(path: Path, exposure: tuple[float, float]) -> ImageFacts:
    data = read_bytes(path)
    try:
        width, height, bits = struct.unpack(">IIB", data[16:25])
        return ImageFacts(width, height, bits, png_chunks(data), exposure)
    except (struct.error, ValueError) as error:
        raise InputError(f"{path}: is not a PNG image ({error})") from error


def _codes(keys: Iterable[object]) -> Ints:
    """Number the distinct keys in the order in which they occur."""
    numbers: dict[object, int] = {}
    return np.array([numbers.setdefault(key, len(numbers)) for key in keys], dtype=np.int64)


def _groups(frames: Sequence[LeakFrame]) -> Ints:
    """Number the groups that are held out as a whole: rigs, or the pushes of a single rig."""
    rigs = _codes(frame.rig for frame in frames)
    return rigs if rigs.any() else _codes(frame.push_id for frame in frames)


def _leak_test(
    name: str, values: Floats, frames: Sequence[LeakFrame], random: np.random.Generator
) -> LeakTest:
    values = values[:, np.ptp(values, axis=0) > 0]
    if not values.size:
        return LeakTest(name, len(frames), 0.0, 0.0)
    values = (values - values.mean(axis=0)) / values.std(axis=0)
    groups = _groups(frames)
    folds = random.permutation(groups.max() + 1)[groups] % FOLDS
    labels = np.array([frame.x_c_over_length for frame in frames])
    rigs = _codes(frame.rig for frame in frames)
    pushes = _codes((frame.rig, frame.push_id) for frame in frames)
    permuted = [labels[_block_permutation(rigs, pushes, random)] for _ in range(PERMUTATIONS)]
    columns = np.column_stack([labels, *permuted])
    r_squared = np.maximum(
        _r_squared(_nearest_neighbours(values, folds) @ columns, columns),
        _r_squared(_ridge(values, folds) @ columns, columns),
    )
    chance = float(np.percentile(r_squared[1:], PERCENTILE))
    return LeakTest(name, len(frames), float(r_squared[0]), chance)


def _block_permutation(rigs: Ints, pushes: Ints, random: np.random.Generator) -> Ints:
    """Draw a permutation of rigs, of the pushes in each, and of the frames in each push.

    `rigs` and `pushes` are those of the frames; no two rigs have the same number of a push.
    """
    rig_keys, push_keys = random.random(rigs.max() + 1), random.random(pushes.max() + 1)
    order = np.empty(len(rigs), dtype=np.int64)
    order[np.lexsort((pushes, rigs))] = np.lexsort(
        (random.random(len(rigs)), push_keys[pushes], rig_keys[rigs])
    )
    return order


# Held-out predictions of both regressors are linear in the labels. Their matrices (frames, frames)
# depend on the features only, so that all permutations cost one product.


def _nearest_neighbours(values: Floats, folds: Ints) -> Floats:
    """Compute the matrix of the mean over the nearest neighbours in the other folds."""
    matrix = np.zeros((len(values), len(values)))
    for fold in range(FOLDS):
        test, train = np.flatnonzero(folds == fold), np.flatnonzero(folds != fold)
        count = round(math.sqrt(len(train)))  # the usual compromise of bias and variance
        distances = cdist(values[test], values[train])
        nearest = np.argpartition(distances, count - 1, axis=1)[:, :count]
        matrix[test[:, None], train[nearest]] = 1 / count
    return matrix


def _ridge(values: Floats, folds: Ints) -> Floats:
    """Compute the matrix of ridge regression, fitted to the other folds."""
    matrix = np.zeros((len(values), len(values)))
    for fold in range(FOLDS):
        test, train = np.flatnonzero(folds == fold), np.flatnonzero(folds != fold)
        mean = values[train].mean(axis=0)
        centred = values[train] - mean
        normal = centred.T @ centred + _RIDGE * len(train) * np.eye(values.shape[1])
        slopes = np.linalg.solve(normal, centred.T)
        matrix[np.ix_(test, train)] = (values[test] - mean) @ slopes + 1 / len(train)
    return matrix


def _r_squared(predictions: Floats, labels: Floats) -> Floats:
    """Compute R^2 of each column (frames, columns)."""
    residuals = ((labels - predictions) ** 2).sum(axis=0)
    return np.asarray(1 - residuals / ((labels - labels.mean(axis=0)) ** 2).sum(axis=0))
