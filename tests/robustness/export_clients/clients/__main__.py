"""Read an export with one client library, and print the checks as JSON.

    python -m tests.robustness.export_clients.clients CLIENT FOLDER EXPECTED

FOLDER is an export, EXPECTED a file with one JSON object per frame of the dataset. Network
connections are refused. The modules of this folder are all of vbaa_bench that is imported: in the
environments of the clients there is nothing else.
"""

import json
import socket
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Final

from tests.robustness.export_clients.clients.check import Check, Rows
from tests.robustness.export_clients.clients.croissant import croissant
from tests.robustness.export_clients.clients.hugging_face import hugging_face
from tests.robustness.export_clients.clients.lerobot import lerobot
from tests.robustness.export_clients.clients.web_dataset import web_dataset

CLIENTS: Final[dict[str, Callable[[Path, Rows], Iterable[Check]]]] = {
    "hf": hugging_face,
    "webdataset": web_dataset,
    "lerobot": lerobot,
    "croissant": croissant,
}


def main() -> None:
    """Run one client and print its checks."""
    client, folder, expected = sys.argv[1:]
    socket.socket.connect = _refuse  # type: ignore[method-assign]
    lines = Path(expected).read_text(encoding="utf-8").splitlines()
    rows = {row["key"]: row for row in map(json.loads, lines)}
    json.dump([check._asdict() for check in CLIENTS[client](Path(folder), rows)], sys.stdout)


def _refuse(*_: object) -> None:
    raise OSError("no network here")


if __name__ == "__main__":
    main()
