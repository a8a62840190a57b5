"""Places of a map: contact distances and deflections, and which of them a rig can reach."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

from solver.instrument.errors import InputError
from solver.instrument.units import DEGREE
from vbaa_bench.assembly.experiment import Experiment
from vbaa_bench.assembly.impossible import Extremes, too_far_or_near
from vbaa_bench.mechanics.state import EquilibriumError, State
from vbaa_bench.scene.files import SceneFileError
from vbaa_bench.scene.frames import Frames, FrameSpec
from vbaa_bench.scene.load import SceneFile
from vbaa_bench.scene.push import PushSpec
from vbaa_bench.scene.random_scene import accepted
from vbaa_bench.scene.rigs import TrueRig, nominal_rig, true_rig
from vbaa_bench.scene.schema import Scene


class Grid(NamedTuple):
    """Contact distances at first contact, in % of L, and deflections of the tip, in % of L."""

    contact_distance_pct: tuple[float, ...]
    deflection_pct: tuple[float, ...]


class Place(NamedTuple):
    """A frame of a map with its state, or None and the reason why it cannot be reached."""

    spec: FrameSpec
    state: State | None
    reason: str = ""


def grid(contact_distances: Sequence[float], deflections: Sequence[float]) -> Grid:
    """Check and sort the places of a map. Raises InputError."""
    for name, values, most in (
        ("contact-distance-pct", contact_distances, 100),
        ("deflection-pct", deflections, 60),
    ):
        wrong = [value for value in values if not 0 < value < most]
        if wrong or not values:
            text = f"{wrong[0]:g}" if wrong else "empty"
            raise InputError(f"--{name} is {text}, allowed is above 0 and below {most}")
    return Grid(tuple(sorted(set(contact_distances))), tuple(sorted(set(deflections))))


def scene_of_map(file: SceneFile, information: str) -> SceneFile:
    """Return the scene with the direction and stiffness of its first push, without occlusion.

    Of keys that are random per push, the first draw is taken. The motor's angle at first contact
    is the middle of its range, the same at all places. The tolerances count as errors of the rig.
    Raises InputError if the object is not touched at a place, if the readings of the `information`
    set are missing, and for linear mechanics.
    """
    spec, sensors = file.scene.object, nominal_rig(file.scene).sensors
    if not spec.present or spec.gap() is not None or spec.mass() is not None:
        lack = "contact distance" if spec.mass() is None else "normal force"
        message = f"is {spec.kind}, which has no {lack}; allowed is any other"
        raise InputError(file.message_at(("object", "kind"), message))
    if file.scene.mechanics == "linear":
        message = "is linear, but the limits are those of the exact beam"
        raise InputError(file.message_at(("mechanics",), message))
    if information == "learned":
        raise InputError(
            "--information is learned, which needs the pushes of a dataset; allowed are the others"
        )
    if information == "moment" and sensors.moment_y is None:
        raise InputError(file.message_at(("moment_sensor",), "is missing, so nothing is read"))
    if information == "force" and (sensors.base_force is None or sensors.base_moment is None):
        raise InputError(file.message_at(("force_sensor",), "is missing, so nothing is read"))
    first = accepted(partial(Frames(file.scene).of_push, 0), f"{file.path}: push 0")[0]
    push, middle = first.push, sum(first.scene.motor_angle_at_contact_deg) / 2
    pushes = PushSpec(
        deflection_pct=(1.0,),
        normal_deg=(push.normal / DEGREE,),
        stiffness_n_m=(1 / push.compliance if push.compliance else "rigid",),
        motor_angle_at_contact_deg=(middle, middle),
    )
    # A rig that is to be built will not be exactly nominal.
    tolerances = first.scene.tolerances.model_copy(update={"true_rig": "drawn"})
    replaced = {
        "pushes": pushes,
        "sampling": None,
        "occlusion": None,
        "random_keys": (),
        "tolerances": tolerances,
    }
    return file.with_scene(first.scene.model_copy(update=replaced))


def rig_of_map(scene: Scene) -> TrueRig:
    """Return the nominal rig of a scene of a map, whose limits include its tolerances."""
    nominal = scene.tolerances.model_copy(update={"true_rig": "nominal"})
    return true_rig(scene.model_copy(update={"tolerances": nominal}))


def places(
    file: SceneFile, rig: TrueRig, contact_distance_mm: float, deflections: Sequence[float]
) -> list[Place]:
    """Push a scene of a map to increasing deflections [%] at one contact distance."""
    changed = {"contact_distance_mm": (contact_distance_mm,), "deflection_pct": tuple(deflections)}
    pushes = file.scene.pushes
    assert pushes is not None
    scene = file.scene.model_copy(update={"pushes": pushes.model_copy(update=changed)})
    file, specs = file.with_scene(scene), Frames(scene).of_push(0)
    if mistakes := too_far_or_near(file, rig):
        return [Place(spec, None, mistakes[0]) for spec in specs]
    states, reasons = _solved(scene, rig, specs, file)
    found = [Place(spec, None, reason) for spec, reason in zip(specs, reasons, strict=True)]
    for step, state in enumerate(states):
        spec = specs[step]
        reason = _impossible(file, rig, spec, state)
        if not reason and not state.contacts:
            reason = "the beam has no contact"
        found[step] = Place(spec, None if reason else state, reason)
    return found


def _solved(
    scene: Scene, rig: TrueRig, specs: Sequence[FrameSpec], file: SceneFile
) -> tuple[list[State], list[str]]:
    """Solve a push as far as possible; return its states, and a reason for each further step."""
    push, reasons = specs[0].push, [""] * len(specs)
    for count in range(len(specs), 0, -1):
        shorter = replace(push, targets=push.targets[:count])
        try:
            return Experiment(scene, rig, shorter, file.folder).states(), reasons
        except SceneFileError:
            raise
        except (EquilibriumError, InputError) as error:
            reasons[count - 1] = str(error)
    return [], reasons


def _impossible(file: SceneFile, rig: TrueRig, spec: FrameSpec, state: State) -> str:
    """Return why a state is impossible, "" if it is not."""
    alone = replace(spec.push, targets=(spec.target,))
    extremes = Extremes(file, rig)
    experiment = Experiment(file.scene, rig, alone, file.folder)
    extremes.add(experiment, [state], {spec.onset})
    return "; ".join(extremes.mistakes())
