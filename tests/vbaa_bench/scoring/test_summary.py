from pathlib import Path

import pytest

from vbaa_bench.scoring import summary


def test_the_machine_is_named_after_its_processor(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The listing of a computer of one core, as Linux writes it."""
    listing = tmp_path / "cpuinfo"
    listing.write_text("processor\t: 0\nmodel name\t: Example CPU @ 2 GHz\nflags\t\t: fpu\n")
    monkeypatch.setattr(summary, "Path", lambda _: listing)
    assert summary.machine()["processor"] == "Example CPU @ 2 GHz"
    listing.write_text("processor\t: 0\nBogoMIPS\t: 48.00\n")  # ARM names no model
    assert summary.machine()["processor"]
