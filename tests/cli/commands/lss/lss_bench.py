"""A session on LSS slaves, and faults at a frame of it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from dvtcli.domain.ports import Frame
from dvtcli.simulator.device.strict_device import StrictDevice
from tests.cli.commands.bench import Bench
from tests.virtual_time import VirtualTimeBus


def bench(*nodes: StrictDevice, **options: Any) -> Bench:
    return Bench((), {"yes": True, **options}, VirtualTimeBus(nodes, simulated=False))


def sent(bus: Any) -> list[Frame]:
    """The frames that are sent from now on."""
    frames: list[Frame] = []
    bus.tap(lambda frame, ours: frames.append(frame) if ours else None)
    return frames


def network(folder: Path, *lines: str) -> str:
    file = folder / "line.yaml"
    file.write_text("nodes:\n" + "".join(f"  {line}\n" for line in lines), "utf-8")
    return str(file)


def power_cycle(*nodes: StrictDevice) -> list[int]:
    """The node-IDs that are left of it."""
    for device in nodes:
        device.restart()
        device.boot_up()
    return [device.node_id for device in nodes]


def is_communication_reset(frame: Frame) -> bool:
    return frame.can_id == 0 and frame.data[0] == 0x82


def at_frame(bus: VirtualTimeBus, matches: Callable[[Frame], bool], number: int, action: Callable[[], None]) -> None:
    """Do *action* when the *number*-th frame that *matches* is sent by dvtcli."""
    count = 0

    def look(frame: Frame, ours: bool) -> None:
        nonlocal count
        if ours and matches(frame):
            count += 1
            if count == number:
                action()

    bus.tap(look)
