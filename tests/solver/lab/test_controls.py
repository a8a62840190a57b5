"""A camera is set before its first frame, and says so where it does not obey."""

from collections.abc import Sequence

import cv2
import pytest

from solver.instrument.errors import InputError
from solver.lab.controls import Controls, controls_of, set_controls


class Adjustable:
    """A camera of two sizes that keeps what it is told."""

    def __init__(self, stubborn: Sequence[int] = ()) -> None:
        self.stubborn, self.order = stubborn, list[int]()
        self.values = {cv2.CAP_PROP_FRAME_WIDTH: 640.0, cv2.CAP_PROP_FRAME_HEIGHT: 480.0}

    def get(self, prop: int, /) -> float:
        return self.values.get(prop, 0.0)

    def set(self, prop: int, value: float, /) -> bool:
        self.order.append(prop)
        if prop in self.stubborn:
            return False
        self.values[prop] = value
        return True

    def getBackendName(self) -> str:  # noqa: N802 - OpenCV's name
        return "V4L2"


def test_what_is_asked_is_set_in_an_order_that_works() -> None:
    camera = Adjustable()
    set_controls(camera, controls_of("1280x720", 50.0, ["gain=4", "fourcc=Y16"]), "camera 0")
    assert camera.order[0] == cv2.CAP_PROP_FOURCC
    assert camera.order.index(cv2.CAP_PROP_AUTO_EXPOSURE) < camera.order.index(
        cv2.CAP_PROP_EXPOSURE
    )
    assert camera.values[cv2.CAP_PROP_FOURCC] == cv2.VideoWriter.fourcc(*"Y16 ")
    assert camera.values[cv2.CAP_PROP_FRAME_WIDTH] == 1280
    assert camera.values[cv2.CAP_PROP_AUTO_EXPOSURE] == 1  # by hand, as V4L2 has it
    assert camera.values[cv2.CAP_PROP_EXPOSURE] == 50
    assert camera.values[cv2.CAP_PROP_GAIN] == 4


@pytest.mark.parametrize(
    ("stubborn", "controls", "said"),
    [
        (
            cv2.CAP_PROP_FRAME_WIDTH,
            Controls(size=(800, 480)),
            "delivers 640 x 480 px, --size is 800x",
        ),
        (cv2.CAP_PROP_EXPOSURE, Controls(exposure=50.0), "rejects the exposure 50, it has 0"),
        (cv2.CAP_PROP_GAIN, controls_of(None, None, ["gain=4"]), "rejects property 14"),
    ],
)
def test_a_camera_that_does_not_obey_is_named(stubborn: int, controls: Controls, said: str) -> None:
    with pytest.raises(InputError, match=f"camera 0 {said}"):
        set_controls(Adjustable([stubborn]), controls, "camera 0")


@pytest.mark.parametrize("size", ["1280", "1280x", "axb", "0x480", "-1x5", "1280x720x3", "9" * 99])
def test_a_size_that_is_none_is_refused(size: str) -> None:
    with pytest.raises(InputError, match="allowed is WIDTHxHEIGHT"):
        controls_of(size, None, [])


@pytest.mark.parametrize("control", ["gain", "gain=much", "gain=inf", "no_such=1", "=", ""])
def test_a_control_that_is_none_is_refused(control: str) -> None:
    with pytest.raises(InputError, match="--control is"):
        controls_of(None, None, [control])
