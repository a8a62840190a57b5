import numpy as np
import pytest

from solver.centreline.stations import stations


def bent() -> tuple[np.ndarray, np.ndarray]:
    """A path in pixels that is flat first and steep then: a parabola of slope u / 100."""
    u = np.linspace(20.3, 219.6, 400)
    return np.column_stack([u, u**2 / 200]), u


def test_stations_lie_on_the_path_in_order_each_column_and_row_once() -> None:
    path, _ = bent()
    places = stations(path, (300, 300))
    u = np.where(places.upright, places.along, places.start)
    v = np.where(places.upright, places.start, places.along)
    assert v == pytest.approx(u**2 / 200, abs=1e-3)
    assert (np.diff(places.length) > 0).all()
    # Columns up to a slope of one, at (100, 50), and rows from there on.
    assert places.along[places.upright].tolist() == list(range(21, 101))
    assert places.along[~places.upright].tolist() == list(range(51, 242))
    slope = np.where(places.upright, u / 100, 100 / u)
    assert places.climb == pytest.approx(slope, abs=0.01)
    assert (places.sense == np.where(places.upright, 1, -1)).all()


def test_a_path_walked_backwards_has_the_same_stations_and_the_opposite_sense() -> None:
    path, _ = bent()
    there, back = stations(path, (300, 300)), stations(path[::-1].copy(), (300, 300))
    assert (there.along == back.along[::-1]).all()
    assert there.start == pytest.approx(back.start[::-1], abs=1e-12)
    assert (there.sense == -back.sense[::-1]).all()
    travelled = there.length + back.length[::-1]
    assert travelled == pytest.approx(travelled[0], abs=1e-9)


def test_stations_stay_within_the_image() -> None:
    path, _ = bent()
    # It leaves below and to the right, where it is read by columns and where it is read by rows.
    for shape, count in (((40, 300), 68), ((300, 90), 69), ((120, 300), 149), ((300, 120), 101)):
        places = stations(path, shape)
        u = np.where(places.upright, places.along, np.rint(places.start))
        v = np.where(places.upright, np.rint(places.start), places.along)
        assert places.size == count
        assert (u < shape[1]).all()
        assert (v < shape[0]).all()
