import gc

import pytest

from solver.instrument.quick_imports import quick_imports


def is_searched(value: object) -> bool:
    return any(one is value for one in gc.get_objects())


def test_nothing_is_collected_within_and_what_exists_is_not_searched_again() -> None:
    with quick_imports():
        assert not gc.isenabled()
        modules = [[number] for number in range(1000)]
        assert is_searched(modules)
    assert gc.isenabled()
    assert not is_searched(modules)


def _failing() -> None:
    with quick_imports():
        raise ImportError


def test_collections_go_on_after_a_failed_import() -> None:
    with pytest.raises(ImportError):
        _failing()
    assert gc.isenabled()


def test_collections_that_were_off_remain_off() -> None:
    gc.disable()
    try:
        with quick_imports():
            pass
        assert not gc.isenabled()
    finally:
        gc.enable()
