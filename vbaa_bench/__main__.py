"""The command `vbaa-bench` as `python -m vbaa_bench`."""

import sys

try:
    from vbaa_bench.cli import main
except ModuleNotFoundError as missing:
    # Python finds this package without an installation in a copy of the repository.
    print(
        f"error: {missing.name} is not installed: pip install '.[bench]' installs it",
        file=sys.stderr,
    )
    raise SystemExit(2) from None

if __name__ == "__main__":
    main()
