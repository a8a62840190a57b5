"""Common base of all sections of a scene: immutable, no unknown keys, no inf or NaN."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

# Generous, but finite: a nanometre to a kilometre in mm; nothing overflows later.
Positive = Annotated[float, Field(ge=1e-6, le=1e6)]
Fraction = Annotated[float, Field(ge=0, le=1)]
Coordinate = Annotated[float, Field(ge=-1e6, le=1e6)]
Triple = tuple[Coordinate, Coordinate, Coordinate]
Tolerance = Annotated[float, Field(ge=0, le=1e3)]
NonNegative = Annotated[float, Field(ge=0, le=1e6)]
Below = Annotated[float, Field(lt=0, ge=-1e6)]
# A tilt of plane D; at a right angle the object would only brush along the beam.
Tilt = Annotated[float, Field(gt=-90, lt=90)]
Turn = Annotated[float, Field(ge=-360, le=360)]
# The motor's angle at first contact is drawn, push by push, from low to high [deg]. If it were
# always the same, the contact could be computed from the encoder and the tip.
Onset = tuple[Turn, Turn]
ONSET: Onset = (-10.0, 10.0)

# Place of a value in a scene: names of sections and keys, and numbers of items of lists.
KeyPath = tuple[str | int, ...]


class Part(BaseModel):
    """Section of a scene."""

    model_config = ConfigDict(
        frozen=True, extra="forbid", allow_inf_nan=False, strict=True, validate_default=True
    )


def check_order(name: str, limits: tuple[float, float]) -> None:
    """Raise ValueError unless the limits of a range are in order."""
    if limits[0] > limits[1]:
        raise ValueError(f"{name} is {list(limits)}, allowed is a range from low to high")
