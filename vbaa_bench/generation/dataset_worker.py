"""One process's part in the generation of a dataset: its methods are the jobs of a pool."""

import contextlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePath
from typing import Final, NamedTuple

from solver.instrument.errors import InputError
from solver.instrument.files import sha256, write_bytes
from solver.instrument.hashes import digest
from solver.instrument.images import png_bytes
from vbaa_bench.assembly.pushes import Pushes
from vbaa_bench.dataset.aside import Aside, aside
from vbaa_bench.dataset.document import read_json
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.writer import ShardWriter, shard_writer
from vbaa_bench.generation.deaths import ImageError
from vbaa_bench.generation.frame_renderer import METERED, FrameRenderer, Metering, RenderedFrame
from vbaa_bench.generation.metering_record import MeteringRecord
from vbaa_bench.scene.files import SceneFileError
from vbaa_bench.scene.frames import FrameName, Frames, FrameSpec
from vbaa_bench.scene.load import SceneFile, recorded_scene
from vbaa_bench.scene.rigs import true_rig

# Errors of the machine or of a file of the scene, and not of the frame that was rendered.
_MACHINE: Final = OSError, MemoryError, SceneFileError
# Longest recorded reason of a failure [characters]. Chosen: a few sentences.
_REASON: Final = 500
# Name of the image that is rendered to measure the exposure, and not kept.
METERING: Final = "the image that meters the exposure"
# The name of a frame, and why it cannot be rendered.
Failure = tuple[str, str]


class WrittenShard(NamedTuple):
    """The sha256 of a shard's hashes.json by tree, and the number of frames that failed."""

    digests: dict[str, str]
    failed: int


@dataclass
class DatasetWorker:
    """Writer of the images and shards of a dataset, whose scene is loaded once."""

    file: SceneFile
    layout: Layout
    variant: str
    threads: int

    def __post_init__(self) -> None:
        scene, rig, folder = self.file.scene, true_rig(self.file.scene), self.file.folder
        self.renderer = FrameRenderer(scene, rig, folder, self.variant, self.threads)
        self._pushes = Pushes(self.file, rig, self.renderer.pushes)
        self._frames = Frames(scene)

    def meter(self, on_progress: Callable[[], None], given_up: Mapping[str, str]) -> MeteringRecord:
        """Measure the exposure; learn the numbers of samples from the first frames.

        Frames that are impossible, fail twice or are given up are left out, and recorded with the
        reasons. Raises ImageError if the exposure cannot be measured.
        """
        failed, specs = dict[str, str](), list[FrameSpec]()
        for name in map(self._frames.name, range(min(len(METERED), self._frames.count))):
            if name.frame_id in given_up:
                failed[name.frame_id] = given_up[name.frame_id]
                continue
            try:
                specs.append(self.spec(name))
            except SceneFileError:
                raise
            except InputError as error:
                failed[name.frame_id] = self._reason(error)
        with aside(self.layout, "meter") as own, self._indispensable(own, METERING):
            exposed = Metering(self.renderer.measure_exposure())
            try:
                metering = self.renderer.learned(exposed, specs, own.begin)
            except _MACHINE:
                raise
            except Exception:  # noqa: BLE001  # a passing error does not come again
                failed |= self._failures(exposed, specs, own)
                specs = [spec for spec in specs if spec.frame_id not in failed]
                metering = self.renderer.learned(exposed, specs, own.begin)
        on_progress()
        return MeteringRecord(metering, tuple(spec.frame_id for spec in specs), failed)

    def _failures(
        self, exposed: Metering, specs: Iterable[FrameSpec], own: Aside
    ) -> Iterator[Failure]:
        """Yield the frames that cannot be rendered to learn from, and the reasons."""
        for spec in specs:
            try:
                self.renderer.learned(exposed, [spec], own.begin)
            except _MACHINE:
                raise
            except Exception as error:  # noqa: BLE001  # recorded
                yield spec.frame_id, self._reason(error)

    def image(self, on_progress: Callable[[], None], name: str, exposure: float) -> str:
        """Save an image of board, beam at rest or ground, such as rest/rest_00.png.

        Return its sha256.

        Raises ImageError if it cannot be rendered.
        """
        kind, _, number = PurePath(name).stem.partition("_")
        rendered = {
            "view": self.renderer.board_image,
            "rest": self.renderer.rest_image,
            "ground": self.renderer.ground_image,
        }[kind]
        with aside(self.layout, image_job(name)) as own, self._indispensable(own, name):
            image = rendered(int(number), exposure)
        data = png_bytes(image)
        write_bytes(self.layout.observations / name, data)
        on_progress()
        return digest(data)

    @contextlib.contextmanager
    def _indispensable(self, own: Aside, name: str) -> Iterator[None]:
        """Name an image without which there is no dataset; an error in it becomes ImageError."""
        own.begin_image(name)
        try:
            yield
        except _MACHINE:
            raise
        except Exception as error:
            raise ImageError(f"{name} cannot be rendered: {self._reason(error)}") from error

    def shard(
        self,
        on_progress: Callable[[], None],
        number: int,
        frames: Sequence[FrameName],
        metering: Metering,
        given_up: Mapping[str, str],
    ) -> WrittenShard:
        """Render and save the frames of one shard.

        A frame that cannot be rendered is recorded with the reason. `given_up` has the reasons of
        frames that are not rendered because their processes died. Raises OSError.
        """
        with shard_writer(self.layout, number) as writer:
            # Frames of a push, which may have looks of its own, one after another.
            for name in sorted(frames, key=lambda name: name.number):
                writer.begin(name.frame_id)
                self._add(writer, name, metering, given_up)
                on_progress()
        return WrittenShard(writer.digests, writer.failed)

    def _add(
        self,
        writer: ShardWriter,
        name: FrameName,
        metering: Metering,
        given_up: Mapping[str, str],
    ) -> None:
        """Render a frame and add it to its shard, or the reason why it is missing."""
        if name.frame_id in given_up:
            writer.add_failure(name.frame_id, given_up[name.frame_id])
            return
        try:
            frame = self.frame(name, metering)
        except _MACHINE:
            raise
        except Exception as error:  # noqa: BLE001  # recorded
            writer.add_failure(name.frame_id, self._reason(error))
            return
        layers = {layer: frame.layers[layer] for layer in map(str, self.file.scene.layers)}
        writer.add(name.frame_id, *frame._replace(layers=layers))

    def frame(self, name: FrameName, metering: Metering) -> RenderedFrame:
        """Render one frame. Raises InputError if its push is impossible."""
        return self.renderer.frame(self.spec(name), metering)

    def spec(self, name: FrameName) -> FrameSpec:
        """Return a frame's specification. Raises InputError if its push is impossible."""
        return self._pushes.frame(name.number)

    def _reason(self, error: Exception) -> str:
        """Return the reason of a failure, which must not depend on where the scene is."""
        text = str(error).replace(f"{self.file.path}: ", "")
        text = text.replace(f"{self.file.path.parent}/", "").splitlines()[0] if text else ""
        name = "" if isinstance(error, InputError) else f"{type(error).__name__}: "
        return f"{name}{text}"[:_REASON]


def image_job(name: str) -> str:
    """Name the job that renders an image, such as rest/rest_00.png."""
    return PurePath(name).stem


def dataset_worker(root: Path, identity: str, variant: str, threads: int) -> DatasetWorker:
    """Build the worker of a dataset from its identity.json, so that jobs need not carry the scene.

    `identity` is the sha256 of that file: a worker of a cluster outlives a dataset, and must not
    render it into another one in the same folder. The files that the scene names are those of which
    the dataset has copies. Raises InputError.
    """
    layout = Layout(root)
    values = read_json(layout.identity)["scene"]
    if sha256(layout.identity) != identity:
        raise InputError(f"{layout.identity}: has changed while the command ran; repeat it")
    file = recorded_scene({"title": root.name, **values}, layout.identity, layout.files)
    return DatasetWorker(file, layout, variant, threads)
