"""A change whose node restarts while it is planned is refused, nothing is written; when it is run again it is made."""

from __future__ import annotations

from pathlib import Path

import pytest

from dvtcli.domain.nmt import NmtCommand
from dvtcli.files.eds.reader import read_eds
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import family_eds, load_family
from tests.cli.commands.bench import Bench
from tests.cli.commands.bus import Wire


class Restarting(StrictDevice):
    """A device that restarts once, after its answer for 0x1800:02, when it is *armed*."""

    armed = False

    def upload(self, index: int, sub_index: int) -> bytes:
        data = super().upload(index, sub_index)
        if self.armed and (index, sub_index) == (0x1800, 2):
            self.armed = False
            self.nmt(NmtCommand.RESET_NODE)
        return data


@pytest.fixture
def node(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Restarting:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    return Restarting(read_eds(family_eds("generic")).dictionary, load_family("generic"), 1)


def bench(wire: Wire) -> Bench:
    return Bench((), {**wire.options, "yes": True, "eds": str(family_eds("generic"))})


def test_it_is_refused_and_made_when_it_is_run_again(node: Restarting) -> None:
    with Wire(node) as wire, bench(wire) as one:
        assert one.run("pdo tpdo1").code == 0
        node.armed = True
        ran = one.script("set tpdo1 --sync 3", "verify")
        assert not node.armed
        assert (ran.code, node.value(0x1800, 2) == b"\x03") == (6, False), ran.stderr
        ran = one.script("set tpdo1 --sync 3", "verify")
        assert ran.code == 0, ran.stderr
        assert one.run("store").code == 0, "nothing speaks against it"


def test_what_was_set_before_it_is_lost_and_that_is_said(node: Restarting) -> None:
    with Wire(node) as wire, bench(wire) as one:
        assert one.run("set tpdo2 --timer 20").code == 0
        node.armed = True
        ran = one.script("set tpdo1 --sync 3")
        assert (ran.code, node.value(0x1800, 2) == b"\x03") == (6, False)
        assert "unstored values are lost (TPDO2)" in ran.stderr
        assert one.script("set tpdo1 --sync 3").code == 0
        assert one.run("undo").code == 0, "the change after it is held"
        assert node.value(0x1800, 2) != b"\x03"
