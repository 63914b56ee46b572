"""A dvtcli that ends in the middle of its work, as after SIGKILL: nothing of it goes on, nothing of it is tidied up.

The process forks at a write: the child has the devices as they are by then and copies of all files, and is whoever
comes after. Does not know what is looked at there.
"""

from __future__ import annotations

import os
import shutil
import traceback
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.operations.network.bench import Chain, Heard, fitting
from tests.surroundings import HOMES


class Watched(Heard):
    """A bus that calls *on_write* after each SDO download that a node took, with the number of those so far.

    What an RPDO could hear by then is noted, whether a frame comes or not, and whatever state its node is in.
    """

    on_write: Callable[[int], None] = staticmethod(lambda _count: None)
    writes = 0

    def fits(self) -> None:
        """Note the layouts of each enabled TPDO, and of each enabled RPDO of another node that takes its frames."""
        self.layouts |= fitting([node.device for node in self.nodes])

    def send_sdo(self, can_id: int, data: bytes) -> None:
        super().send_sdo(can_id, data)
        if data[0] >> 5 == 1:
            self.writes += 1
            self.fits()
            self.on_write(self.writes)


def afterwards(chain: Chain, home: Path, look: Callable[[Chain], None]) -> str:
    """What went wrong where this process had ended here and *look* came after, on *chain*'s devices and files.

    *home* is where the files of the user are.
    """
    return in_own_process(home.parent / "report", lambda: _look(chain, home, look))


def in_own_process(report: Path, act: Callable[[], None]) -> str:
    """What went wrong in *act*, which a copy of this process does and writes into the file *report*."""
    if not hasattr(os, "fork"):
        pytest.skip("no fork of POSIX, by which a test continues with a copy of the devices")
    report.unlink(missing_ok=True)
    child = os.fork()
    if not child:
        try:
            act()
        except BaseException:  # noqa: BLE001 - the child has nobody else to tell
            report.write_text(traceback.format_exc())
        finally:
            os._exit(0)
    os.waitpid(child, 0)
    return report.read_text() if report.exists() else ""


def _look(chain: Chain, home: Path, look: Callable[[Chain], None]) -> None:
    """The lock is held by the process that goes on: whoever comes after has files of its own."""
    other = home.parent / "after"
    for folder in (home, chain.folder):
        shutil.copytree(folder, other / folder.name)
    for lock in (other / home.name).rglob("*.lock"):  # it notes where the journal is
        lock.write_text(lock.read_text().replace(str(chain.folder), str(other / chain.folder.name)))
    for name in HOMES:
        os.environ[name] = str(other / home.name)
    chain.folder = other / chain.folder.name
    layouts = chain.bus.layouts
    chain.bus = type(chain.bus)(list(chain.devices.values()), [])
    chain.bus.layouts |= layouts
    try:
        look(chain)
    finally:
        shutil.rmtree(other)
