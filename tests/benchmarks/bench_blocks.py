"""SDO block transfers against the bits of the wire: how much of the time the bus carries frames, in virtual time.

    python -m tests.benchmarks.bench_blocks

A device that answers 0.5 ms after a request's last bit. By segments beside it: the same with a device without block
transfers. No real time, so that the figures are the same everywhere.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import load_family
from tests.laws.bench import dictionary
from tests.wire_timed_bus import WireTimedBus

OBJECT, SERVER_S = (0x2002, 0), 0.0005


class Measured(NamedTuple):
    """One transfer: how long it took (s), and which part of that the wire carried frames."""

    what: str
    seconds: float
    used: float


def measure(size: int, bitrate: int = 500_000, *, block_size: int = 127) -> list[Measured]:
    """A download and an upload of *size* bytes at *bitrate* (bit/s); a *block_size* of 0: by segments."""
    node = StrictDevice(dictionary("generic"), load_family("generic")._replace(block_size=block_size), 1)
    node.boot_up()
    node.take_outbox()
    node.set_value(0x1017, 0, bytes(2))  # no heartbeat
    bus = WireTimedBus([node], bitrate, SERVER_S)
    data = bytes(count * 7 % 251 for count in range(size))
    transfers: dict[str, Callable[[], object]] = {
        "download": lambda: bus.sdo(1).download(*OBJECT, data),
        "upload": lambda: bus.sdo(1).upload(*OBJECT),
    }
    found = []
    for what, transfer in transfers.items():
        bus.begin()
        started_s = bus.now_s()
        transfer()
        seconds = bus.now_s() - started_s
        found.append(Measured(what, seconds, bus.bits / bitrate / seconds))
    return found


def main() -> None:
    for bitrate in (125_000, 500_000, 1_000_000):
        for way, block_size in (("blocks", 127), ("segments", 0)):
            for what, seconds, used in measure(100_000, bitrate, block_size=block_size):
                print(f"{bitrate // 1000:5} kbit/s  {what:8} of 100,000 bytes by {way:8} {seconds:6.2f} s  {used:5.1%}")


if __name__ == "__main__":
    main()
