"""The kinds of input, by name, in the order of the command's options."""

from collections.abc import Mapping
from typing import Final

from vbaa_bench.benchmarks.fuzz.case import KindFactory
from vbaa_bench.benchmarks.fuzz.images import Images
from vbaa_bench.benchmarks.fuzz.predictions import Predictions
from vbaa_bench.benchmarks.fuzz.records import Records
from vbaa_bench.benchmarks.fuzz.rigs import Rigs
from vbaa_bench.benchmarks.fuzz.scenes import Scenes
from vbaa_bench.benchmarks.fuzz.settings import Settings
from vbaa_bench.benchmarks.fuzz.tables import Tables

KINDS: Final[Mapping[str, KindFactory]] = {
    "scenes": Scenes,
    "rigs": Rigs,
    "tables": Tables,
    "images": Images,
    "predictions": Predictions,
    "records": Records,
    "settings": Settings,
}
