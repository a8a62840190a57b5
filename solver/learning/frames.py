"""Learn the beam from the images of a set of observations."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

from solver.antenna import Antenna
from solver.instrument.errors import InputError
from solver.instrument.image_frame import LEARN, ImageFrame
from solver.instrument.measurement import Measurement
from solver.learning.clamp_offset import ObjectRadius
from solver.learning.learn import LearnedBeam, learn_beam
from solver.to_measurement import to_measurement
from solver.tracker import extract_centreline, reject_moved_camera


def frames_to_learn(frames: Sequence[ImageFrame]) -> list[ImageFrame]:
    """Return the frames of the split LEARN, or all if no frame has a split."""
    chosen = [frame for frame in frames if frame.split == LEARN]
    return chosen or [frame for frame in frames if not frame.split]


def learn_from_frames(
    antenna: Antenna, frames: Iterable[ImageFrame], radius: ObjectRadius | None = None
) -> LearnedBeam:
    """Learn the beam from images of pushes; frames without a push are pushes of their own.

    Images that cannot be used are left out. `radius` is that of the objects. Raises InputError as
    `learn_beam`.
    """
    pushes: dict[str, list[Measurement]] = {}
    for frame in frames:
        measurement = measurement_of(antenna, frame)
        if measurement is not None:
            pushes.setdefault(frame.push_id or frame.frame_id, []).append(measurement)
    if not pushes:
        raise InputError("no image shows the beam, needed are two pushes to learn it")
    return learn_beam(list(pushes.values()), radius)


def with_learned(antenna: Antenna, beam: LearnedBeam) -> Antenna:
    """Return the antenna with what was learned of its rig."""
    return replace(antenna, rig=beam.rig(antenna.rig))


def measurement_of(antenna: Antenna, frame: ImageFrame) -> Measurement | None:
    """Measure the beam in a frame's image; None if the image cannot be used."""
    try:
        image = frame.image()
        if reject_moved_camera(antenna, image) is not None:
            return None
        return to_measurement(antenna, extract_centreline(antenna, image), frame.readings)
    except (InputError, ValueError):
        return None
