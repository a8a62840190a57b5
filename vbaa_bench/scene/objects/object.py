"""Base of the kinds of object: keys, and what follows from them. `docs/kinds.md` has an example.

Objects are in their own frame: the contact is at the origin, +y is the outward normal there,
towards the beam, and +z is the direction of the edge; x runs along the beam. The solid is in
y <= 0. At first contact the beam's centreline is the line y = its radius, z = 0. The topology of a
mesh depends on an object's sizes, never on how far the beam has pushed into it.

An object is fixed in the world except for its drift. It yields along its own normal with the
stiffness in `pushes.stiffness_n_m`, and friction acts along the beam.
"""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Final, NamedTuple, Protocol

import numpy as np
from pydantic import Field, model_validator

from solver.instrument.arrays import Floats
from solver.instrument.units import DEGREE, MILLIMETRE
from vbaa_bench.geometry.mesh import Mesh
from vbaa_bench.mechanics.surfaces import Surface
from vbaa_bench.scene.families import Family
from vbaa_bench.scene.paint import PaintedPart
from vbaa_bench.scene.part import Below, NonNegative, Part, Triple
from vbaa_bench.scene.textures.texture import AnyTexture


@dataclass(frozen=True, eq=False)
class FileMesh:
    """A mesh [m] that was read from a file. Equal ones are the same object."""

    path: Path
    mesh: Mesh


class MeshFiles(Protocol):
    """Reader of the mesh files that a scene names."""

    def mesh(self, name: str, unit_m: float) -> FileMesh:
        """Read a file whose unit is `unit_m`. Raises SceneFileError, and InputError for a size."""


class ObjectSetting(NamedTuple):
    """What the shape of an object refers to: the beam's radius and the height of the ground [m]."""

    beam_radius: float
    ground: float
    files: MeshFiles


class Touchable(NamedTuple):
    """Where a beam can touch an object, which mechanics models as an endless edge or wall.

    `low` and `high` are the ends of the edge along z [m], `half_width` is the extent to both sides
    along x [m], and `flank` the largest inclination of the beam to x [rad].
    """

    low: float = -math.inf
    high: float = math.inf
    half_width: float = math.inf
    flank: float = math.pi / 2


class ObjectKind(Part, ABC):
    """What the beam is pushed against, or what hangs from it."""

    # Whether there is an object at all.
    present: ClassVar[bool] = True
    # Whether its mesh shows how far it yields.
    deforms: ClassVar[bool] = False
    # Whether it is touched at a straight, sharp edge.
    sharp: ClassVar[bool] = False
    # Whether the paper's linear theory describes the contact.
    linear: ClassVar[bool] = False
    if TYPE_CHECKING:
        kind: str  # the order of the fields of ours is older than this class

    @abstractmethod
    def surface(self, setting: ObjectSetting) -> Surface:
        """Build the contact surface. Raises InputError if a mesh is bad."""

    @abstractmethod
    def mesh(self, setting: ObjectSetting, give: float = 0.0, slope: float = 0.0) -> Mesh:
        """Build the mesh [m], deformed by `give` [m] by a beam of the given slope against x."""

    def touchable(self, _setting: ObjectSetting) -> Touchable:
        """Return where the beam can touch the object."""
        return Touchable()

    def gap(self) -> float | None:
        """Return the distance [m] of a wall beside the beam; None if touched at a distance."""
        return None

    def mass(self) -> float | None:
        """Return the mass [kg] of a load that hangs from the beam; None if it is touched."""
        return None

    def friction_coefficient(self) -> float:
        """Return Coulomb's coefficient of friction along the beam."""
        return 0.0

    def drift(self) -> tuple[float, float, float]:
        """Return the motion [m] from one step of a push to the next; see `TouchedKind`."""
        return 0.0, 0.0, 0.0

    def object_from_table(self, _setting: ObjectSetting) -> Floats:
        """Compute the pose (4, 4) of the object's table in the object's frame.

        The object is fixed on the table, whose frame is that of a mesh's file; for other objects
        it is the object's own.
        """
        return np.eye(4)

    def misses(self, setting: ObjectSetting, touched: Floats, tangent: Floats) -> str | None:
        """Explain why a beam cannot touch the object at a point (3,) [m] with a given tangent.

        Both are in the object's frame. Return None if the beam can touch the finite object there.
        """
        mm, x, z = MILLIMETRE, float(touched[0]), float(touched[2])
        low, high, half, flank = self.touchable(setting)
        if not low <= z <= high:
            return (
                f"the beam slides off the end of the object, to {z / mm:.3g} mm along its edge, "
                f"allowed is {low / mm:.4g} to {high / mm:.4g} mm"
            )
        if abs(x) > half:
            return (
                f"the beam touches {abs(x) / mm:.4g} mm from the object's middle, "
                f"allowed is up to {half / mm:.4g} mm"
            )
        inclination = abs(float(np.arctan2(tangent[1], tangent[0])))
        if inclination > flank:
            return (
                f"the beam leans by {inclination / DEGREE:.3g} degrees, into the object's flank, "
                f"allowed is {flank / DEGREE:.3g}"
            )
        return None


class TouchedKind(PaintedPart, ObjectKind):
    """An object with a surface that is painted and may be rough."""

    friction: Annotated[float, Field(ge=0, le=1)] = Field(
        default=0.0,
        description="Coulomb's coefficient of friction along the beam; zero is the paper's "
        "extremely slippery object.",
    )
    drift_mm: Triple = Field(
        default=(0.0, 0.0, 0.0),
        description="Motion of the object from one step of a push to the next, along the axes of "
        "the antenna at first contact.",
    )
    texture: AnyTexture | None = Field(
        default=None,
        description="Texture of every side, along the axis that it faces most; on bare steel it "
        "is one of gloss.",
    )

    def friction_coefficient(self) -> float:
        """Return the coefficient of friction."""
        return self.friction

    def drift(self) -> tuple[float, float, float]:
        """Return the drift."""
        x, y, z = self.drift_mm
        return x * MILLIMETRE, y * MILLIMETRE, z * MILLIMETRE

    @model_validator(mode="after")
    def _check_texture(self) -> "TouchedKind":
        if self.texture is not None and not self.finish.takes_texture:
            raise ValueError(
                f"texture is given and paint is {self.paint}, allowed is any other paint"
            )
        return self


class UprightKind(TouchedKind):
    """Object with an upright front, from its bottom to its top."""

    top_mm: NonNegative = Field(default=0.4, description="Height of the top above plane C.")
    bottom_mm: Below | None = Field(
        default=None, description="Height of the bottom; by default it stands on the background."
    )

    def heights(self, setting: ObjectSetting) -> tuple[float, float]:
        """Return bottom and top [m]."""
        bottom = setting.ground if self.bottom_mm is None else self.bottom_mm * MILLIMETRE
        return bottom, self.top_mm * MILLIMETRE

    def touchable(self, setting: ObjectSetting) -> Touchable:
        """Return the front, from bottom to top."""
        low, high = self.heights(setting)
        return Touchable(low, high)


OBJECTS: Final[Family[ObjectKind]] = Family()
AnyObject = Annotated[ObjectKind, OBJECTS]
