"""Ways to reach a CANopen network. Importing this package imports no CAN library: opening a bus does."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dvtcli.bus.python_can import CanBus
    from dvtcli.simulator.device.faults import Fault
    from dvtcli.simulator.device.signals import Signal
    from dvtcli.simulator.device.strict_device import StrictDevice

DEFAULT_TIMEOUT_S = 0.5
DEFAULT_RETRIES = 1


def open_canbus(
    interface: str | None = None,
    channel: str | None = None,
    bitrate: int | None = None,
    extra: Mapping[str, object] | None = None,
    *,
    timeout_s: float = DEFAULT_TIMEOUT_S,
    retries: int = DEFAULT_RETRIES,
) -> CanBus:
    """Open a CAN interface; raises BusUnavailable with the reason and a hint.

    *interface*, *channel*, *bitrate* (bit/s) and *extra* have python-can's names and meaning; what is None
    comes from python-can's own configuration. *timeout_s* is the SDO time-out, *retries* (0..) how often a
    read's first request is repeated after it.
    """
    from dvtcli.bus.opening import open_bus

    return open_bus(interface, channel, bitrate, extra or {}, timeout_s=timeout_s, retries=retries)


def open_simulation(
    devices: Sequence[StrictDevice],
    *,
    faults: Sequence[Fault] = (),
    signals: Sequence[Signal] = (),
    timeout_s: float = DEFAULT_TIMEOUT_S,
    retries: int = DEFAULT_RETRIES,
) -> CanBus:
    """Open a bus on which only the simulated *devices* live, *faults* and *signals* included; nothing leaves us."""
    from dvtcli.simulator.network.in_process_bus import simulate

    return simulate(devices, faults=faults, signals=signals, timeout_s=timeout_s, retries=retries)


def is_configured() -> bool:
    """Whether python-can's own files or environment name an interface."""
    return library_settings().get("interface") is not None


def library_settings() -> dict[str, tuple[object, str]]:
    """What python-can's own files and environment say, by key, each with where it stands."""
    from dvtcli.bus.opening import library_settings

    return library_settings()
