"""Recordings that begin and end by marks on the bus, never by the clock: a slow machine records the same.

Does not know what is recorded between the marks.
"""

from __future__ import annotations

import re
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import can

from tests.harness.forked import Forked
from tests.process import PATIENCE_S, documents, start
from tests.simulator.serve.served import own_environment, wait_for

#: CAN-IDs of 29 bits, which nothing else here sends: what records is there, and has everything until there
BEGUN, OVER = 0x1FFFFF01, 0x1FFFFF02
#: how a CAN-ID stands in a candump file, and in what `monitor --json` says
CANDUMP, MONITORED = "{:08X}#", '"cob_id":{},'
#: how much of a recording's end is looked at (bytes)
_TAIL = 1 << 20
#: a frame of 11 bits in a candump file, whoever wrote it
_SHORT = re.compile(r"^\(\S+\) \S+ [0-9A-F]{3}#", re.MULTILINE)


def mark(link: str, can_id: int, *paths: Path, form: str = CANDUMP) -> None:
    """Send *can_id* on *link* until all recordings at *paths* have it, in the *form* of theirs."""
    until_s = time.monotonic() + PATIENCE_S
    with can.Bus(
        link, interface="socketcan", ignore_config=True, can_filters=[{"can_id": 0, "can_mask": 0x7FF}]
    ) as bus:
        while not all(path.exists() and form.format(can_id) in _end(path) for path in paths):
            assert time.monotonic() < until_s, f"no recording of {can_id:X} within {PATIENCE_S:.0f} s"
            bus.send(can.Message(arbitration_id=can_id))
            time.sleep(0.05)


def _end(path: Path) -> str:
    with path.open("rb") as file:
        file.seek(max(0, path.stat().st_size - _TAIL))
        return file.read().decode("utf-8", "replace")


def frames_in(path: Path) -> int:
    """How many frames of 11 bits a recording in candump's format has."""
    return len(_SHORT.findall(path.read_text("utf-8")))


@contextmanager
def candump(link: str, path: Path) -> Iterator[None]:
    """can-utils' recorder on *link* into *path*, with as much room in the kernel as it can ask for."""
    with path.open("w") as file, subprocess.Popen(["candump", "-L", "-r", "8000000", link], stdout=file) as dump:
        try:
            yield
        finally:
            dump.terminate()


def log(link: str, path: Path, *beside: Path, meanwhile: Callable[[], object]) -> dict[str, Any]:
    """What `log` into *path* says, which ran from before *meanwhile* until all of it was there, as those *beside* did.

    It is ended by Ctrl-C.
    """
    words = ["-i", "socketcan", "-c", link, "log", str(path), "--json"]
    logging = start(words, env=own_environment(path.parent))
    try:
        mark(link, BEGUN, path, *beside)
        meanwhile()
        mark(link, OVER, path, *beside)
        document, ended = documents(interrupted(logging))
        assert ended["schema"] == "dvtcli.error/1", ended
    finally:
        logging.kill()
    return document


def interrupted(process: Forked) -> str:
    """Standard output of *process*, which Ctrl-C ends."""
    process.send_signal(signal.SIGINT)
    out, errors = process.communicate(PATIENCE_S)
    assert process.returncode == 128 + signal.SIGINT, errors
    return out


def seen_by(process: Forked, said: Callable[[list[dict[str, Any]]], bool]) -> list[dict[str, Any]]:
    """The documents of *process* when *said* of those so far, one a line, is true; Ctrl-C ends it then."""
    wait_for(lambda: said(documents(process.so_far()[0].rpartition("\n")[0])), "what it is to show")
    return documents(interrupted(process))
