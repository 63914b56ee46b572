"""Open the bus of the options: simulated nodes in this process, or a real interface."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from time import monotonic, time
from typing import TYPE_CHECKING, Protocol, TypeVar

from dvtcli.domain.nmt import UNCONFIGURED
from dvtcli.domain.ports import CanopenBus
from dvtcli.errors import BusUnavailable, UsageError
from dvtcli.operations.session.simulated_nodes import (
    Simulated,
    file_or_family,
    read_dictionary,
    simulated_device,
    simulated_faults,
    simulated_nodes,
    simulated_signals,
)
from dvtcli.operations.user.options import Options

if TYPE_CHECKING:
    from dvtcli.operations.results.frames import BusEvent
    from dvtcli.simulator.device.simulated_faults import Fault
    from dvtcli.simulator.device.strict_device import StrictDevice
    from dvtcli.simulator.network.signals import SimulatedSignal

#: Opens the bus of options.
OpenBus = Callable[[Options], CanopenBus]


class StartSimulation(Protocol):
    """Starts simulated devices on their own bus and joins it."""

    def __call__(
        self,
        devices: Sequence[StrictDevice],
        *,
        faults: Sequence[Fault],
        signals: Sequence[SimulatedSignal],
        timeout_s: float,
        bit_rate: int,
    ) -> CanopenBus:
        """Return the bus of *devices*, which boot now, with *faults* and *signals*, at *bit_rate* (bit/s)."""
        ...


def bus_of(
    options: Options, open_bus: OpenBus | None = None, simulate: StartSimulation | None = None
) -> tuple[CanopenBus, tuple[Simulated, ...]]:
    """Open the bus of *options*, or with *open_bus*; also returns its simulated nodes with their node-IDs.

    Simulated nodes are on the bus of *simulate*, None: the bus in this process.

    Raises BusUnavailable, UsageError or InputFileError.
    """
    if options.eds:
        read_dictionary(file_or_family(options.eds), options.chosen_modules)  # said at once
    simulated = simulated_nodes(options.sim, options.modules)
    if simulated and (options.interface or options.channel):
        raise UsageError(
            "a simulated node has its own bus, but an interface was given, too",
            given={"nodes": None},
            hint="leave one out",
        )
    faults = simulated_faults(options.fault, simulated)
    signals = simulated_signals(options.signal, simulated)
    if not simulated:
        return (open_bus or open_real_bus)(options), ()
    from dvtcli.simulator.network import in_process_bus

    devices, rate = (
        [simulated_device(simulated_node) for simulated_node in simulated],
        options.bitrate or in_process_bus.BIT_RATE,
    )
    start = simulate or in_process_bus.simulate
    return start(devices, faults=faults, signals=signals, timeout_s=options.timeout, bit_rate=rate), tuple(
        simulated_node for simulated_node in simulated if simulated_node.node_id != UNCONFIGURED
    )


def open_real_bus(options: Options) -> CanopenBus:
    """Open the interface of *options*, else of python-can's settings; raises BusUnavailable."""
    from dvtcli.bus.opening import open_transport

    return open_transport(
        options.interface, options.channel, options.bitrate, options.adapter_settings, timeout_s=options.timeout
    )


def listening_bus(options: Options, bit_rate: int, *, listen_only: bool) -> CanopenBus:
    """Open the interface of *options* at *bit_rate* (bit/s), silent if *listen_only*.

    Raises SafetyRefusal if silence is not guaranteed or the bit rate cannot be set; BusUnavailable.
    """
    from dvtcli.bus.opening import open_listening

    return open_listening(
        options.interface, options.channel, bit_rate, options.adapter_settings, listen_only=listen_only
    )


B = TypeVar("B")
OnBusEvent = Callable[["BusEvent"], None]


def gone(name: str, failed: BusUnavailable) -> BusEvent:
    """Make the event of the bus *name* that *failed*."""
    from dvtcli.operations.results.frames import BusEvent

    reason = failed.why or failed.text
    return BusEvent(name, time(), f"{reason}; {failed.hint}" if failed.hint else reason)


def first_bus(opened: Callable[[], B], options: Options, on_bus_event: OnBusEvent) -> B:
    """Call *opened*(); with the option `reconnect`, wait for a missing bus until Ctrl-C."""
    try:
        return opened()
    except BusUnavailable as failed:
        if not (options.reconnect and failed.may_come) or options.no_reconnect:
            raise
        name = failed.text.removeprefix("cannot open ")
        bus = waited_for(opened, name, failed, lambda: False, on_bus_event)
    assert bus is not None  # noqa: S101 - nothing stops it but an exception
    return bus


def waited_for(
    opened: Callable[[], B], name: str, failed: BusUnavailable, stopping: Callable[[], bool], on_bus_event: OnBusEvent
) -> B | None:
    """Call *opened*() until it succeeds after the bus *name* has *failed*; None as soon as *stopping*()."""
    from dvtcli.bus.opening import wait_for_bus
    from dvtcli.operations.results.frames import BusEvent

    began_s = monotonic()
    on_bus_event(gone(name, failed))
    bus = wait_for_bus(opened, stopping)
    if bus is not None:
        on_bus_event(BusEvent(name, time(), after_s=monotonic() - began_s))
    return bus
