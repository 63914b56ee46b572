"""A bus that is lost behind what nodes act on: wherever that is, nobody is told that nothing was done."""

from __future__ import annotations

from collections.abc import Iterable

import pytest

from dvtcli.domain.ports import Frame
from dvtcli.errors import BusUnavailable
from dvtcli.operations.session.simulated_nodes import simulated_device, simulated_nodes
from tests.cli.commands.bench import Bench, Ran
from tests.virtual_time import VirtualTimeBus

GEN4 = "vendor=0x1E product=0x0705302D revision=0x30000 serial=0x12345"


class CutBus(VirtualTimeBus):
    """A bus whose driver fails for good once *left* frames of ours went out; *acted*: whether one made a node act."""

    left = -1
    cut = acted = False

    def _use(self) -> None:
        super()._use()
        if self.cut:
            raise BusUnavailable("the bus is gone")

    def _send(self, frame: Frame) -> None:
        super()._send(frame)
        self.acted |= acts(frame)
        self.left -= 1
        self.cut = not self.left


def acts(frame: Frame) -> bool:
    """Whether *frame* changes something: a download, what LSS sets (0x7E5), all that is no request."""
    if frame.can_id == 0x7E5:
        return frame.data[0] in (0x11, 0x13, 0x15, 0x17)
    return frame.data[0] >> 5 == 1 if 0x600 < frame.can_id < 0x680 else not frame.remote


def bus_of(family: str) -> CutBus:
    return CutBus([simulated_device(one) for one in simulated_nodes([f"{family}@3"])], simulated=False)


def cut_everywhere(family: str, line: str, *before: str) -> Iterable[tuple[CutBus, Ran]]:
    """*line* on node 3 of *family*, on a bus that is lost behind the first frame, behind the second and so on."""
    for left in range(1, 400):
        bus = bus_of(family)
        with Bench((), {"node": 3, "yes": True}, bus) as bench:
            for one in before:
                assert bench.run(one).code == 0, one
            bus.left, bus.acted = left, False
            ran = bench.run(f"{line} --json")
            if ran.code == 0:  # it was lost, if at all, behind the last frame that had to be answered
                return
            assert bus.cut, ran
            yield bus, ran


@pytest.mark.parametrize(
    ("family", "line"),
    [
        ("gen4", "nmt start"),
        ("gen4", "nmt stop all"),
        ("gen4", "nmt reset-node"),
        ("gen4", f"lss node-id 7 {GEN4}"),
        ("gen4", "sync --count 3"),
        ("gen4-locked", "login"),
    ],
)
def test_what_went_out_is_said_and_unchanged_only_where_nothing_did(
    family: str, line: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("DVTCLI_PASSCODE", "0x4444")
    seen = set()
    for bus, ran in cut_everywhere(family, line):
        error = ran.documents[-1]
        assert (ran.code, error["schema"]) in {(5, "dvtcli.error/1"), (7, "dvtcli.error/1")}, ran
        assert (error["state"] == "unchanged") == (not bus.acted), (bus.left, error)
        seen.add(error["state"])
    assert seen - {"unchanged"}


def test_the_state_names_what_went_out() -> None:
    bus = bus_of("gen4")
    with Bench((), {"node": 3}, bus) as bench:
        bus.left = 1
        ran = bench.run("nmt start")
        assert ran.code == 5
        assert "state   unknown: NMT start to node 3 was sent before that; read the device again" in ran.stderr
        assert "unchanged" in bench.run("nmt start").stderr  # of another line: nothing goes out any more


def test_what_a_line_before_it_sent_is_not_its_own() -> None:
    bus = bus_of("gen4")
    with Bench((), {"node": 3}, bus) as bench:
        assert bench.run("nmt start").code == 0
        bus.left = 1
        assert bench.run("read 1018:4 --json").document["state"] == "unchanged"
