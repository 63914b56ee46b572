"""Wait for a missing bus, with a message at the start and at its arrival."""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic, time
from typing import TYPE_CHECKING, TypeVar

from dvtcli.errors import BusUnavailable
from dvtcli.operations.results.bus_events import BusEvent

if TYPE_CHECKING:
    from dvtcli.operations.user.options import Options

B = TypeVar("B")
Tell = Callable[[BusEvent], None]


def gone(name: str, failed: BusUnavailable) -> BusEvent:
    """Make the event of the bus *name* that *failed*."""
    reason = failed.why or failed.text
    return BusEvent(name, time(), f"{reason}; {failed.hint}" if failed.hint else reason)


def first_bus(opened: Callable[[], B], options: Options, tell: Tell) -> B:
    """Call *opened*(); with the option `reconnect`, wait for a missing bus until Ctrl-C."""
    try:
        return opened()
    except BusUnavailable as failed:
        if not (options.reconnect and failed.may_come) or options.no_reconnect:
            raise
        name = failed.text.removeprefix("cannot open ")
        bus = waited_for(opened, name, failed, lambda: False, tell)
    assert bus is not None  # noqa: S101 - nothing stops it but an exception
    return bus


def waited_for(
    opened: Callable[[], B], name: str, failed: BusUnavailable, stopping: Callable[[], bool], tell: Tell
) -> B | None:
    """Call *opened*() until it succeeds after the bus *name* has *failed*; None as soon as *stopping*()."""
    from dvtcli.bus.waiting import wait_for_bus

    began_s = monotonic()
    tell(gone(name, failed))
    bus = wait_for_bus(opened, stopping)
    if bus is not None:
        tell(BusEvent(name, time(), after_s=monotonic() - began_s))
    return bus
