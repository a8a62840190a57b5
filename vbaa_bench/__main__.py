"""The command `vbaa-bench` as `python -m vbaa_bench`."""

from vbaa_bench.cli import main

if __name__ == "__main__":
    main()
