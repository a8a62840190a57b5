"""Contact sheet of random draws of a scene: what a dataset will look like."""

from collections.abc import Callable
from typing import Any

import cv2
import numpy as np

from solver.instrument.errors import InputError
from vbaa_bench.api.data import usable_variant, worker_count
from vbaa_bench.api.frame import rendered_frame
from vbaa_bench.api.scene import AnyScene
from vbaa_bench.assembly.plan import accepted_rig
from vbaa_bench.report.gallery import whole
from vbaa_bench.scene.frames import Frames
from vbaa_bench.scene.load import SceneFile, load_scene
from vbaa_bench.workers.machine import Machine
from vbaa_bench.workers.pool import Pool

# Width of a tile, height of its caption and number of columns. Chosen: fits a screen.
_TILE_PX, _CAPTION_PX, _COLUMNS = 384, 20, 5
_PAPER, _INK = 255, (30, 30, 30)


def preview(
    scene: AnyScene,
    draws: int = 30,
    *,
    workers: int | None = None,
    variant: str | None = None,
    progress: Callable[[int, int], None] = lambda _done, _total: None,
) -> bytes:
    """Render draws of a scene with random keys, with the truth, and return them as one PNG.

    Of a collection these are frames of different rigs, else different frames. Impossible draws are
    blank tiles with the reason. Raises InputError if nothing in the scene is random.

    >>> import vbaa_bench as vb
    >>> camera = {"width_px": 256, "height_px": 88, "focal_length_px": 350}
    >>> camera |= {"position_mm": [120, 22, 360], "look_at_mm": [120, 22, 0]}
    >>> board = {"columns": 20, "rows": 5, "square_mm": 10, "center_mm": [120, 22]}
    >>> beam = {"diameter_mm": {"uniform": [0.6, 1.0]}}
    >>> pushes = {"contact_distance_mm": [120], "deflection_pct": [10]}
    >>> keys = {"camera": camera, "calibration": board, "beam": beam, "pushes": pushes}
    >>> scene = vb.Scene(title="Beams", seed=1, rigs=2, **keys)
    >>> vb.preview(scene, 2, workers=1)[:4]
    b'\\x89PNG'
    """
    file = scene if isinstance(scene, SceneFile) else load_scene(scene)
    if not (file.is_random or file.scene.random_keys or file.scene.sampling):
        raise InputError(f"{file.path}: nothing is random, so that all draws are equal")
    chosen_variant = usable_variant(variant)
    processes = worker_count(workers, chosen_variant)
    jobs: list[tuple[str, tuple[Any, ...]]] = [("tile", (file, number)) for number in range(draws)]
    threads = Machine(chosen_variant, processes).threads_each
    with Pool(processes, DrawRenderer, (chosen_variant, threads)) as pool:
        encoded = pool.run(jobs, lambda done: progress(done, draws))
    tiles = [
        np.asarray(cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR))
        for data in encoded
    ]
    height = max(len(tile) for tile in tiles)
    padded = [
        np.pad(tile, ((0, height - len(tile)), (0, 0), (0, 0)), constant_values=_PAPER)
        for tile in tiles
    ]
    blank = np.full_like(padded[0], _PAPER)
    padded += [blank] * (-len(padded) % _COLUMNS)
    rows = [np.hstack(padded[i : i + _COLUMNS]) for i in range(0, len(padded), _COLUMNS)]
    return bytes(cv2.imencode(".png", np.vstack(rows))[1])


class DrawRenderer:
    """One worker's renderer of draws."""

    def __init__(self, variant: str, threads: int) -> None:
        self._variant, self._threads = variant, threads

    def tile(self, on_progress: Callable[[], None], file: SceneFile, number: int) -> bytes:
        """Render one draw as a PNG with a caption."""
        try:
            picture, caption = self._draw(file, number)
        except InputError as error:
            picture = np.full((_TILE_PX // 3, _TILE_PX, 3), _PAPER, np.uint8)
            caption = str(error).rpartition("because ")[2][-60:]
        tile = np.full((_CAPTION_PX + len(picture), _TILE_PX, 3), _PAPER, np.uint8)
        tile[_CAPTION_PX:] = picture
        cv2.putText(tile, caption, (3, 14), cv2.FONT_HERSHEY_SIMPLEX, 0.36, _INK, 1, cv2.LINE_AA)
        on_progress()
        return bytes(cv2.imencode(".png", tile)[1])

    def _draw(self, file: SceneFile, number: int) -> tuple[np.ndarray, str]:
        rigs = file.rigs
        rig = accepted_rig(file, number % rigs if rigs else 0)
        # Every further rig shows another of its frames.
        frame_number = number % Frames(rig.scene).count
        frame = rendered_frame(rig, frame_number, self._variant, exact=False, threads=self._threads)
        drawn = whole(frame.overlay, 1)
        scale = _TILE_PX / drawn.shape[1]
        picture = cv2.resize(drawn, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
        name = f"rig {number % rigs}, " if rigs else ""
        return np.asarray(picture, np.uint8), f"{name}frame {frame_number}: {frame.title}"[:60]
