"""The kinds of input, by name, in the order of the command's options."""

from collections.abc import Mapping
from typing import Final

from tests.robustness.fuzz.case import KindFactory
from tests.robustness.fuzz.images import Images
from tests.robustness.fuzz.predictions import Predictions
from tests.robustness.fuzz.records import Records
from tests.robustness.fuzz.rigs import Rigs
from tests.robustness.fuzz.scenes import Scenes
from tests.robustness.fuzz.settings import Settings
from tests.robustness.fuzz.tables import Tables

KINDS: Final[Mapping[str, KindFactory]] = {
    "scenes": Scenes,
    "rigs": Rigs,
    "tables": Tables,
    "images": Images,
    "predictions": Predictions,
    "records": Records,
    "settings": Settings,
}
