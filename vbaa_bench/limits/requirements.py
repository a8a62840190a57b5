"""Required accuracies, such as 0.1 % of L for x_c and 1 mN for the force."""

from typing import Final, NamedTuple

from solver.instrument.errors import InputError, quoted


class Accuracy(NamedTuple):
    """A limited quantity in one unit, such as x_c in % of L."""

    quantity: str
    suffix: str
    unit: str

    @property
    def key(self) -> str:
        """Name in a requirement, such as x_c_pct_L."""
        return f"{self.quantity}_{self.suffix}"

    @property
    def column(self) -> str:
        """Column of the limit, such as x_c_limit_pct_L."""
        return f"{self.quantity}_limit_{self.suffix}"

    def exists(self, information: str) -> bool:
        """Test whether an information set has a limit of this quantity."""
        if self.quantity == "psi":
            return information != "planar"
        return self.quantity != "compliance" or information == "push"


X_C: Final = Accuracy("x_c", "pct_L", "% of L")
FORCE: Final = Accuracy("force", "mn", "mN")
RELATIVE_FORCE: Final = Accuracy("force", "pct", "%")
PSI: Final = Accuracy("psi", "deg", "deg")
COMPLIANCE: Final = Accuracy("compliance", "mm_per_n", "mm/N")
# The first of each quantity is its usual unit.
ACCURACIES: Final = (
    X_C,
    Accuracy("x_c", "mm", "mm"),
    Accuracy("s_c", "mm", "mm"),
    FORCE,
    RELATIVE_FORCE,
    PSI,
    COMPLIANCE,
)


class Requirement(NamedTuple):
    """The largest standard deviation that is allowed."""

    accuracy: Accuracy
    most: float

    def __str__(self) -> str:
        """Format the requirement for a heading."""
        return f"{self.accuracy.quantity} ≤ {self.most:g} {self.accuracy.unit}"


def requirements(texts: list[str], information: str) -> tuple[Requirement, ...]:
    """Parse requirements such as "x_c_pct_L=0.1,force_mn=1". Raises InputError."""
    parts = [part for text in texts for part in text.split(",")]
    return tuple(_requirement(part, information) for part in parts)


def _requirement(text: str, information: str) -> Requirement:
    name, _, number = text.partition("=")
    accuracy = next((one for one in ACCURACIES if one.key == name.strip()), None)
    try:
        most = float(number)
    except ValueError:
        most = 0.0
    if accuracy is None or not 0 < most < float("inf"):
        names = ", ".join(one.key for one in ACCURACIES)
        raise InputError(
            f"--require is {quoted(text)}, allowed is NAME=NUMBER with a number above 0 and a name "
            f"of {names}"
        )
    if not accuracy.exists(information):
        raise InputError(f"--require is {quoted(text)}, but {information} has no such limit")
    return Requirement(accuracy, most)
