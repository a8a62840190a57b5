"""The image sensor."""

from typing import Annotated, Any, Literal

from pydantic import Field, SerializerFunctionWrapHandler, model_serializer, model_validator

from solver.instrument.units import MICRO, PERCENT
from vbaa_bench.scene.part import NonNegative, Part

# The photosites of the upper left corner of a Bayer mosaic, row by row.
BayerPattern = Literal["rggb", "bggr", "grbg", "gbrg"]

# Fields that an ideal sensor may set; all others keep their defaults.
_IDEAL = ("bits", "beam_peak_pct", "rest_images", "ground_images", "exposure_s", "line_time_us")

_PartsPerMillion = Annotated[float, Field(ge=0, le=1e5)]
_Signal = Annotated[float, Field(ge=0.01, le=1)]


class BayerSpec(Part):
    """Bayer mosaic over the photosites; images are reconstructed in colour and converted to gray.

    All surfaces and lamps are gray: a channel differs from another only by its signal, the
    product of the lamp's colour and the filter's sensitivity. The exposure is metered in the most
    sensitive channel.
    """

    pattern: BayerPattern = Field(
        default="rggb", description="The photosites of the upper left corner, row by row."
    )
    red: _Signal = Field(
        default=0.6, description="Signal of the red photosites, relative to the others."
    )
    green: _Signal = Field(
        default=1.0, description="Signal of the green photosites, relative to the others."
    )
    blue: _Signal = Field(
        default=0.5, description="Signal of the blue photosites, relative to the others."
    )
    white_balance: bool = Field(
        default=True,
        description="Whether the channels are scaled to the same signal of a gray surface.",
    )
    demosaicing: Literal["bilinear", "edge_aware"] = Field(
        default="bilinear", description="How the colours between photosites are reconstructed."
    )


class SensorSpec(Part):
    """Image sensor, exposed so that the resting beam peaks at `beam_peak_pct` of full scale.

    If a tenth of the image is brighter than the beam, that part peaks there instead. The terms
    are those of EMVA Standard 1288. The gray values of an ideal sensor are radiance, rounded and
    clipped at full scale.
    """

    kind: Literal["real", "ideal"] = Field(
        default="real",
        description="A real sensor has noise; gray values of an ideal one are radiance, "
        "rounded and clipped at full scale.",
    )
    bits: Literal[8, 10, 12, 14, 16] = Field(
        default=8,
        description="Bits of a gray value; above 8, images are 16-bit PNG that hold gray "
        "values from 0 to 2^bits - 1.",
    )
    full_well_e: Annotated[float, Field(ge=10, le=1e7)] = Field(
        default=10_000, description="Electrons at which a pixel is full."
    )
    read_noise_e: NonNegative = Field(
        default=10, description="Standard deviation of a pixel's reading, in electrons."
    )
    beam_peak_pct: Annotated[float, Field(gt=0, le=100)] = Field(
        default=70,
        description="Gray value, in per cent of full scale, at which the resting beam peaks.",
    )
    rest_images: Annotated[int, Field(ge=1, le=1000)] = Field(
        default=4, description="Number of images of the beam at rest."
    )
    ground_images: Annotated[int, Field(ge=0, le=1000)] = Field(
        default=0,
        description="Number of images of the ground without the beam, as taken before it is "
        "mounted.",
    )
    quantum_efficiency: Annotated[float, Field(gt=0, le=1)] = Field(
        default=1.0,
        description="Electrons per photon; as the beam's peak is prescribed, a lower one "
        "needs more light and does not change the image.",
    )
    dark_current_e_s: NonNegative = Field(default=0.0, description="Dark current of a pixel.")
    exposure_s: Annotated[float, Field(gt=0, le=3600)] = Field(
        default=0.005, description="Integration time."
    )
    line_time_us: NonNegative = Field(
        default=0.0,
        description="Rolling shutter: delay from the exposure of one row to that of the row "
        "below. With 0 all rows are exposed at once; the middle row is exposed at the frame's "
        "nominal time.",
    )
    prnu_pct: Annotated[float, Field(ge=0, le=20)] = Field(
        default=0.0,
        description="Photo-response non-uniformity: standard deviation of the sensitivity "
        "over the pixels.",
    )
    dsnu_e: NonNegative = Field(
        default=0.0,
        description="Dark-signal non-uniformity: standard deviation of the dark signal over "
        "the pixels, in electrons.",
    )
    hot_pixels_ppm: _PartsPerMillion = Field(
        default=0.0,
        description="Pixels with additional dark current; which ones is drawn once per dataset.",
    )
    hot_dark_current_e_s: Annotated[float, Field(ge=0, le=1e9)] = Field(
        default=200_000,
        description="Mean of the hot pixels' additional dark current, which is exponentially "
        "distributed.",
    )
    dead_pixels_ppm: _PartsPerMillion = Field(
        default=0.0,
        description="Pixels without response to light; which ones is drawn once per dataset.",
    )
    gain_e_per_gray: Annotated[float, Field(ge=1e-6, le=1e6)] | None = Field(
        default=None,
        description="Electrons per gray value before gamma; by default, the full well is at "
        "full scale.",
    )
    black_level_gray: Annotated[float, Field(ge=0, lt=65535)] = Field(
        default=0.0, description="Gray value of a dark pixel."
    )
    gamma: Annotated[float, Field(ge=1, le=4)] = Field(
        default=1.0,
        description="Gray over full scale is its linear value to the power of 1 / gamma.",
    )
    bayer: BayerSpec | None = Field(
        default=None, description="Colour filters; without them, the sensor is monochrome."
    )
    jpeg_quality: Annotated[int, Field(ge=1, le=100)] | None = Field(
        default=None,
        description="Quality at which every image is compressed as JPEG, which is also one "
        "frame of Motion JPEG, and decoded; files are PNG of the decoded gray values. Of a "
        "colour image, only the gray one is compressed.",
    )

    @model_serializer(mode="wrap")
    def _without_ground(self, serialised: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Leave `ground_images` out where there are none: the files of earlier datasets stay."""
        values: dict[str, Any] = serialised(self)
        if not self.ground_images:
            values.pop("ground_images", None)
        return values

    @property
    def line_time_s(self) -> float:
        """Delay from the exposure of one row to that of the row below."""
        return self.line_time_us * MICRO

    @property
    def full_scale(self) -> int:
        """Largest gray value."""
        return int(2**self.bits - 1)

    @property
    def gain(self) -> float:
        """Electrons per gray value, before gamma."""
        return self.gain_e_per_gray or self.full_well_e / (self.full_scale - self.black_level_gray)

    @property
    def dark_signal(self) -> float:
        """Mean number of electrons of a pixel after a dark frame."""
        return self.dark_current_e_s * self.exposure_s

    @property
    def peak_signal(self) -> float:
        """Electrons, dark signal included, of a pixel where the resting beam peaks."""
        return self.gain * (self._linear_peak - self.black_level_gray)

    @property
    def _linear_peak(self) -> float:
        """Gray value of the beam's peak, before gamma."""
        return float(self.full_scale * (self.beam_peak_pct * PERCENT) ** self.gamma)

    @model_validator(mode="after")
    def _check_ideal(self) -> "SensorSpec":
        forbidden = [
            name
            for name, field in type(self).model_fields.items()
            if name not in ("kind", *_IDEAL) and getattr(self, name) != field.default
        ]
        if self.kind == "ideal" and forbidden:
            raise ValueError(
                f"kind is ideal and {', '.join(forbidden)} given, allowed with it are "
                f"{', '.join(_IDEAL)}"
            )
        return self

    @model_validator(mode="after")
    def _check_compression(self) -> "SensorSpec":
        if self.jpeg_quality is not None and self.bits != 8:
            raise ValueError(
                f"jpeg_quality is {self.jpeg_quality} and bits is {self.bits}, allowed with "
                "jpeg_quality is 8: JPEG images have 8 bits"
            )
        return self

    @model_validator(mode="after")
    def _check_signal_range(self) -> "SensorSpec":
        black, peak = self.black_level_gray, self._linear_peak
        if not black < peak:
            raise ValueError(
                f"black_level_gray is {black:g}, allowed is below {peak:g}, the beam's gray value "
                "before gamma"
            )
        # A full well at full scale may be off by a rounding error.
        if self.peak_signal > self.full_well_e * (1 + 1e-12):
            raise ValueError(
                f"beam_peak_pct is {self.beam_peak_pct:g}, with this gain {self.peak_signal:g} "
                f"electrons, allowed is at most the full well of {self.full_well_e:g}"
            )
        if not self.dark_signal < self.peak_signal:
            raise ValueError(
                f"dark_current_e_s times exposure_s is {self.dark_signal:g} electrons, allowed is "
                f"below the {self.peak_signal:g} at which the beam peaks"
            )
        return self

    @model_validator(mode="after")
    def _check_noise(self) -> "SensorSpec":
        for name in ("read_noise_e", "dsnu_e"):
            if getattr(self, name) >= self.full_well_e:
                raise ValueError(
                    f"{name} is {getattr(self, name):g}, allowed is below the full well of "
                    f"{self.full_well_e:g}"
                )
        return self
