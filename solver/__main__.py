"""Command line of the solver: `python -m solver OBSERVATIONS --method exact_fit`."""

import os
import sys

from solver.instrument.errors import InputError
from solver.instrument.quick_imports import quick_imports

# Linear algebra in one thread: matrices are small, and threads that wait for each other slow down
# a machine with other work. NumPy reads this when it is first imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
try:
    with quick_imports():
        from solver.lab.command_line import main
except ModuleNotFoundError as missing:
    # Python finds this package without an installation in a copy of the repository.
    print(f"error: {missing.name} is not installed: pip install . installs it", file=sys.stderr)
    raise SystemExit(2) from None
except KeyboardInterrupt:
    raise SystemExit(130) from None
except InputError as error:
    print(f"error: {error}", file=sys.stderr)
    raise SystemExit(2) from None

__all__ = ["main"]

if __name__ == "__main__":
    main()
