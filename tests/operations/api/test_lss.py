"""`bus.lss`: what the commands do, for a program; a wrong argument is said before anything is sent."""

from __future__ import annotations

from collections.abc import Callable

import pytest

import dvtcli
from dvtcli.errors import NoAnswer, SafetyRefusal, UsageError

GEN4 = (0x1E, 0x705302D, 0x30000, 0x12345)


def test_a_program_finds_names_and_stores_a_node() -> None:
    with dvtcli.simulate("gen4@255") as bus:
        assert bus.lss.identify().answered == 1
        assert bus.lss.identify((*GEN4[:2], (0, 0x3FFFF), GEN4[3])).within
        assert not bus.lss.identify((*GEN4[:3], (1, GEN4[3] - 1)))
        (found,) = bus.lss.scan().nodes
        assert found.address.parts == GEN4
        with pytest.raises(SafetyRefusal):
            bus.lss.node_id(5, found.address)
        assert bus.lss.node_id(5, found.address, yes=True).nodes[0].node_id == 5
        assert bus.node(5).read((0x1018, 1)).value == 0x1E
        assert bus.lss.select(5).nodes[0].node_id == 5
        assert bus.lss.node_id(6, yes=True).nodes[0].before == 5
        assert bus.lss.store(6, prove=True, yes=True).nodes[0].proved
        with pytest.raises(NoAnswer):
            bus.lss.select((1, 2, 3, 4))


@pytest.mark.parametrize(
    "call",
    [
        lambda lss: lss.node_id(128),
        lambda lss: lss.node_id(5, (1, 2, 3)),
        lambda lss: lss.identify((1, 2, 3, 1 << 32)),
        lambda lss: lss.identify((1, 2, 3, (5, 4))),
        lambda lss: lss.identify((1, 2, 3, (4, 5, 6))),
        lambda lss: lss.identify((1, (2, 3), 3, (4, 5))),
        lambda lss: lss.select(0),
        lambda lss: lss.store(5, prove="no"),
        lambda lss: lss.scan(0),
        lambda lss: lss.bit_rate(1),
        lambda lss: lss.bit_rate(100_000, yes=True),
        lambda lss: lss.assign(5),
    ],
)
def test_a_wrong_argument_is_said(call: Callable[[dvtcli.Lss], object]) -> None:
    with dvtcli.simulate("gen4@255") as bus, pytest.raises(UsageError):
        call(bus.lss)
