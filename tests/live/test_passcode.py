"""A passcode that passes on the bus is in no recording."""

from __future__ import annotations

from collections.abc import Callable

from dvtcli.domain.ports import Frame
from dvtcli.live.listener import Listener
from dvtcli.network import Secrets

LOGIN = Frame(0x601, bytes.fromhex("2B 00 50 02 44 44 00 00"), timestamp_s=1.0)
OTHERS = (
    Frame(0x601, bytes.fromhex("2B 00 50 03 01 00 00 00"), timestamp_s=1.0),
    Frame(0x581, bytes.fromhex("60 00 50 02 00 00 00 00"), timestamp_s=1.0),
    Frame(0x181, bytes.fromhex("2B 00 50 02 44 44 00 00"), timestamp_s=1.0),
)


class Replayed:
    """A bus on which *LOGIN* and others pass at once."""

    def tap(self, callback: Callable[[Frame, bool], None]) -> Callable[[], None]:
        for frame in (LOGIN, *OTHERS):
            callback(frame, False)
        return lambda: None

    def idle(self, duration_s: float) -> None:
        assert duration_s > 0


def test_the_value_is_kept_as_zeros_and_nothing_else_is_touched() -> None:
    with Listener(Replayed(), is_secret=Secrets.known().in_frame) as listener:
        kept, *others = listener.take(1.0)
    assert kept.data == bytes.fromhex("2B 00 50 02 00 00 00 00")
    assert [frame.data for frame in others] == [frame.data for frame in OTHERS]


def test_lines_that_may_hold_a_passcode() -> None:
    secrets = Secrets.known()
    for line in ("write 5000:2 1", "write 0x5000:02 0x4444", "sdo_wnx 1 0x5000 2 0x4444", "sdo_wnx 1 5000 02 17476 2"):
        assert secrets.in_line(line), line
    for line in ("read 5000:1", "write 5000:3 1", "map tpdo1 5000:21", "write 1017 5000", "login 4"):
        assert not secrets.in_line(line), line
