"""Wait for a lost bus, report loss and return in a line each, and reopen it by its options.

Shared by all commands that continue by themselves.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from time import monotonic, time
from typing import TYPE_CHECKING

from dvtcli.operations.opening.first_bus import Tell, gone
from dvtcli.operations.results.bus_events import BusEvent

if TYPE_CHECKING:
    from dvtcli.domain.ports import CanopenBus
    from dvtcli.errors import BusUnavailable
    from dvtcli.operations.session.session import Session
    from dvtcli.operations.session.session_nodes import SessionNodes


def goes_on(session: SessionNodes, *, unasked: bool) -> bool:
    """Tell whether a lost bus is waited for: with --reconnect, or *unasked*; never with --no-reconnect.

    Simulated nodes of this process end with their bus.
    """
    options = session.options
    return (unasked or options.reconnect) and not options.no_reconnect and not session.wire.simulated


def come_back(
    session: Session,
    bus: CanopenBus,
    failed: BusUnavailable,
    stopping: Callable[[], bool],
    tell: Tell | None = None,
    between: Callable[[], AbstractContextManager[object]] = nullcontext,
) -> bool:
    """Wait until *bus*, which *failed*, can be reopened for the session; False as soon as *stopping*().

    *tell* gets loss and return. The session changes inside *between*() only, while nobody uses its nodes. Returns at
    once if somebody else reopened it.
    """
    tell = tell or session.tell.bus
    began_s = monotonic()
    event = gone(bus.name, failed)
    tell(event)
    with between():
        if session.wire is not bus:
            return True
        session.leave_bus(event.text)
    from dvtcli.bus.waiting import wait_for_bus

    opened = wait_for_bus(session.bus_again, stopping)
    if opened is None:
        return False
    with between():
        if stopping() or session.wire is not bus:  # by now nobody needs it
            opened.close()
            return not stopping()
        session.take_bus(opened)
    tell(BusEvent(opened.name, time(), after_s=monotonic() - began_s))
    return True
