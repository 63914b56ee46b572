"""A bus that goes and comes back: said in one line each, waited for in between, opened by the options that named it.

One place for all who go on by themselves. Does not know what they do with the bus.
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


def goes_on(session: Session, *, unasked: bool) -> bool:
    """Whether a bus that is gone is waited for: with --reconnect, or *unasked*; never with --no-reconnect.

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
    """Wait until *bus*, which *failed*, opens again, and let the session have it; False as soon as *stopping*().

    *tell* hears that it is gone and that it is back. The session is changed inside of *between*() only, when nothing
    is done with its nodes. Where somebody else opened it meanwhile that is all.
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
