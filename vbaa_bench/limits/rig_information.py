"""Fisher information on a rig before any contact: board, beam at rest, and stated tolerances."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Final

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.camera import Camera
from vbaa_bench.assembly.experiment import Experiment
from vbaa_bench.assembly.scene_assembler import SceneAssembler
from vbaa_bench.assembly.shared_world import draws_new_grime
from vbaa_bench.limits.board_information import BOARD, board_information
from vbaa_bench.limits.camera_parameters import camera_parameters
from vbaa_bench.limits.dirt import Dirt, information_through_dirt
from vbaa_bench.limits.image_shape import PlacesInformation, image_information, image_shape
from vbaa_bench.limits.imaged_beam import FRACTIONS, PLACES, ImagedBeam, Neighbours
from vbaa_bench.limits.information import Information
from vbaa_bench.limits.lit_beam import LitBeam
from vbaa_bench.limits.prior import rig_prior, shape_prior, uncertain_parameters
from vbaa_bench.limits.profile import PixelNoise, SurfaceProfile, Variance, information
from vbaa_bench.limits.section import sections
from vbaa_bench.limits.tip import BeamEnd, tip_information
from vbaa_bench.mechanics.state import State, interpolated
from vbaa_bench.scene.rigs import TrueRig
from vbaa_bench.scene.schema import Scene
from vbaa_bench.sensor.from_spec import image_sensor, metered_exposure

# Places along the beam at which the information of its profile is computed; it is smooth in
# between. Measured: with twice as many, limits change by less than 1 %.
_PROFILES: Final = 12


@dataclass(frozen=True)
class RigInformation:
    """What the images before any contact inform on. `folder` contains the scene's files."""

    scene: Scene
    rig: TrueRig
    folder: Path

    @cached_property
    def before_contact(self) -> Information:
        """Information of board, rest images and tolerances on clamp, beam, camera and width."""
        imaged, state = self._at_rest
        neighbours = imaged.neighbours(self.parameters(self.rig.camera))
        count = self.scene.sensor.rest_images
        images = self.of_image(imaged, state, neighbours, np.ones(PLACES), images=count)
        rest = images.eliminated({"brightness", "background"})
        board = board_information(self._lit.assembler, self.exposure)
        return self._tolerances + shape_prior(self.scene) + board + rest

    def of_image(
        self,
        imaged: ImagedBeam,
        state: State,
        neighbours: Mapping[str, Neighbours],
        visible: Floats,
        scene: Scene | None = None,
        images: int = 1,
    ) -> Information:
        """Compute the information of images on the parameters of `neighbours` and APPEARANCE.

        Arguments are those of `of_places`.
        """
        places = self.of_places(imaged, state, visible, scene, images)
        return image_information(image_shape(imaged, neighbours), places)

    def of_places(
        self,
        imaged: ImagedBeam,
        state: State,
        visible: Floats,
        scene: Scene | None = None,
        images: int = 1,
    ) -> PlacesInformation:
        """Compute the information of the places on one image of the beam, or on several alike.

        `visible` (n,) is the visible fraction of PLACES equal parts of the beam's length. `scene`
        has the light and the paints of this image, by default those at rest.
        """
        of_profile, of_tip = self._of_profile(imaged, state, scene or self.scene, images)
        visible = visible * imaged.camera.contains(imaged.pixels[1:-1])
        return PlacesInformation(visible[:, None, None] * of_profile, float(of_tip * visible[-1]))

    def parameters(self, camera: Camera) -> tuple[str, ...]:
        """List the parameters of the rig on which an image depends."""
        return (*uncertain_parameters(self.scene), *camera_parameters(camera))

    @cached_property
    def exposure(self) -> float:
        """Exposure as metered on the beam at rest."""
        imaged, state = self._at_rest
        metered = sections(imaged, state, np.linspace(0.05, 0.95, _PROFILES))
        peak = self._lit.peak_radiance(imaged.rod, self.rig.camera, metered)
        return metered_exposure(self.scene.sensor, peak)

    @cached_property
    def _tolerances(self) -> Information:
        """The stated accuracy of clamp, beam and board."""
        return rig_prior(self.scene)

    @property
    def errorless(self) -> Information | None:
        """Tolerances of a rig that is exactly nominal; None if its errors are drawn from them."""
        return self._tolerances if self.scene.tolerances.true_rig == "nominal" else None

    @property
    def known(self) -> frozenset[str]:
        """Parameters of the board's pose that are stated to be exact."""
        return frozenset(BOARD) - set(self._tolerances.names)

    def _of_profile(
        self, imaged: ImagedBeam, state: State, scene: Scene, images: int
    ) -> tuple[Floats, float]:
        """Compute the information (n, 4, 4) of the profile at PLACES, and of the tip.

        Images of the beam at rest have the same dirt, which their mean contains.
        """
        at = np.linspace(0.0, 1.0, _PROFILES)
        lit = self._lit if scene is self.scene else self._lit_in(scene)
        surfaces = lit.surfaces(imaged.rod, imaged.camera, sections(imaged, state, at))
        sensor = image_sensor(self.scene.sensor, self.exposure * scene.light_level)
        noise = PixelNoise.of(self.scene.sensor, sensor)

        def variance(radiance: Floats) -> Floats:
            return noise.variance(radiance) / images

        length_px = float(np.linalg.norm(np.diff(imaged.pixels, axis=0), axis=1).sum())
        dirt = lit.dirt if draws_new_grime(self.scene) else None
        known = np.array([_of_surface(surface, variance, dirt, length_px) for surface in surfaces])
        of_places = interpolated(FRACTIONS[1:-1], at, known.reshape(len(at), -1))
        of_tip = tip_information(surfaces[-1], BeamEnd.of(imaged), variance)
        return of_places.reshape(PLACES, 4, 4), of_tip

    @cached_property
    def _at_rest(self) -> tuple[ImagedBeam, State]:
        experiment = Experiment.at_rest(self.scene, self.rig, self.folder)
        return ImagedBeam.at_rest(experiment, self.rig.camera), experiment.rest

    @cached_property
    def _lit(self) -> LitBeam:
        return self._lit_in(self.scene)

    def _lit_in(self, scene: Scene) -> LitBeam:
        """Return the beam in the light of a scene."""
        return LitBeam(SceneAssembler(scene, self.rig, self.folder))


def _of_surface(
    surface: SurfaceProfile,
    variance: Variance,
    dirt: Dirt | None,
    length_px: float,
) -> Floats:
    """Compute the information (4, 4) of one pixel of the beam's length, through its dirt if any."""
    if dirt is None:
        return information(surface, variance)
    return information_through_dirt(surface, variance, dirt.density(surface, length_px))
