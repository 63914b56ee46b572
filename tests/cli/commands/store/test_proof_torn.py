"""A second Ctrl-C while a store is proved: what the device acknowledged before is said all the same."""

from __future__ import annotations

import pytest

from dvtcli.domain.ports import Frame
from tests.cli.commands.bench import Bench, beside
from tests.simulator.bench import booted


@pytest.mark.parametrize("after", [3, 20, 45])
def test_it_is_said_what_the_device_has_acknowledged(after: int) -> None:
    with Bench((), {"sim": (), "node": 1, "yes": True}, beside([booted("generic")])) as bench:
        assert bench.run("set tpdo1 --timer 70").code == 0
        seen = list[Frame]()

        def tear(frame: Frame, ours: bool) -> None:
            if seen or bytes(frame.data[:3]) == b"\x60\x10\x10":
                seen.append(frame)
            if len(seen) == after and ours:
                raise KeyboardInterrupt
            if len(seen) == after:
                seen.pop()

        untap = bench.session.open_network().bus.tap(tear)
        ran = bench.run("store --prove")
        untap()
        assert ran.code == 130, ran
        assert "0x1010:01 acknowledged the store, which is not proved" in ran.stderr
        assert bench.run("set tpdo3 --timer 0 --json").document["writes"] == 0, "the test of the reset is rolled back"
