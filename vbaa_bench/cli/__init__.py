"""The command `vbaa-bench`.

The modules of this package define names, options and help texts, and import little. A command
imports what it needs when it runs, so that help and version appear at once.
"""

from vbaa_bench.cli.interrupt import importing

with importing():
    from vbaa_bench.cli.main import app, main

__all__ = ["app", "main"]
