"""Learn the beam from the images of a set of observations."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

from solver.antenna import Antenna
from solver.instrument.errors import InputError
from solver.instrument.image_frame import LEARN, ImageFrame
from solver.instrument.measurement import Measurement
from solver.learning.clamp_offset import ObjectRadius
from solver.learning.learn import LearnedBeam, learn_beam
from solver.to_measurement import to_measurement
from solver.tracker import extract


def frames_to_learn(frames: Sequence[ImageFrame]) -> list[ImageFrame]:
    """Return the frames of the split LEARN, or all if no frame has a split.

    Raises InputError if all frames have another split.
    """
    chosen = [frame for frame in frames if frame.split == LEARN]
    chosen = chosen or [frame for frame in frames if not frame.split]
    if frames and not chosen:
        raise InputError(f"no frame has the split {LEARN!r}, and each has another one")
    return chosen


def learn_from_frames(
    antenna: Antenna,
    frames: Iterable[ImageFrame],
    radius: ObjectRadius | None = None,
    left_out: Callable[[ImageFrame, str], None] = lambda _frame, _reason: None,
) -> LearnedBeam:
    """Learn the beam from images of pushes; frames without a push are pushes of their own.

    Images that cannot be used are left out; `left_out` is called with the frame and the reason.
    `radius` is that of the objects. Raises InputError as `learn_beam`.
    """
    pushes: dict[str, list[Measurement]] = {}
    reason = "there is none"
    for frame in frames:
        try:
            measurement = measured(antenna, frame)
        except InputError as error:
            reason = str(error)
            left_out(frame, reason)
        else:
            pushes.setdefault(frame.push_id or frame.frame_id, []).append(measurement)
    if not pushes:
        raise InputError(
            f"no image to learn from shows the beam ({reason}), needed are two pushes to learn it"
        )
    return learn_beam(list(pushes.values()), radius)


def with_learned(antenna: Antenna, beam: LearnedBeam) -> Antenna:
    """Return the antenna with what was learned of its rig."""
    return replace(antenna, rig=beam.rig(antenna.rig))


def measured(antenna: Antenna, frame: ImageFrame) -> Measurement:
    """Measure the beam in a frame's image. Raises InputError if the image cannot be used."""
    line, moved = extract(antenna, frame.image())
    if moved is not None:
        raise InputError(moved.message)
    return to_measurement(antenna, line, frame.readings)


def measurement_of(antenna: Antenna, frame: ImageFrame) -> Measurement | None:
    """Measure the beam in a frame's image; None if the image cannot be used."""
    try:
        return measured(antenna, frame)
    except InputError:
        return None
