"""Find a bus's bit rate by listening at each of the standard's. Sends nothing.

At a wrong bit rate, a controller destroys frames of others unless in listen-only mode: without this mode it does not
listen.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.lss_services import BIT_TIMINGS
from dvtcli.errors import BusUnavailable, SafetyRefusal
from dvtcli.operations.results.lss_nodes import BitRateFound, ReceivedAt

if TYPE_CHECKING:
    from dvtcli.domain.ports import CanopenBus
    from dvtcli.operations.session.session_nodes import SessionNodes
    from dvtcli.operations.user.session_user import SessionUser

#: How long each bit rate is listened to (s): nodes usually send a heartbeat once a second or more often.
LISTEN_S = 1.5
#: the standard's bit rates (bit/s), most frequent first
ORDER = (500_000, 250_000, 125_000, 1_000_000, 50_000, 20_000, 10_000, 800_000)
assert set(ORDER) == set(BIT_TIMINGS)  # noqa: S101 - all of them


def find_bit_rate(session: SessionNodes, listen_s: float = LISTEN_S) -> BitRateFound:
    """Listen at each standard bit rate for *listen_s* seconds, until frames arrive without errors.

    Raises SafetyRefusal, with a remedy, if listen-only mode is not guaranteed (unless forced, after a question; used
    anyway if available), or the bit rate cannot be set. An open bus returns to its bit rate. Raises BusUnavailable.
    """
    try:
        return _found(session, listen_s, silent=True)
    except (SafetyRefusal, BusUnavailable):  # also: it does not confirm listen-only mode
        if not _spoken(session):
            raise
    return _found(session, listen_s, silent=False)


def _found(session: SessionNodes, listen_s: float, *, silent: bool) -> BitRateFound:
    with _listening(session, listen_only=silent) as (bus, rates):
        received: list[ReceivedAt] = []
        for number, bit_rate in enumerate(rates):
            session.reporter.progress(f"listening at {bit_rate} bit/s, {listen_s:g} s", number, len(rates))
            if bus.runs_at != bit_rate or not silent:
                bus.set_bit_rate(bit_rate, listen_only=silent)
            received.append(_received(bus, bit_rate, listen_s))
            if received[-1].frames and not received[-1].error_frames:
                return BitRateFound(bus.name, bit_rate, tuple(received), listen_s, silent)
        return BitRateFound(bus.name, None, tuple(received), listen_s, silent, complete=len(rates) == len(ORDER))


def _spoken(session: SessionUser) -> bool:
    """Tell whether frames of others may be destroyed: forced, and confirmed."""
    if not session.options.force or session.dry_run:
        return False
    session.consent("without listen-only mode a wrong bit rate destroys the frames of others; is the machine at rest?")
    return True


def _received(bus: CanopenBus, bit_rate: int, listen_s: float) -> ReceivedAt:
    for _ in bus.receive(0.0):
        pass  # what came before came at another bit rate
    errors = bus.error_frame_count()
    frames = sum(1 for _ in bus.receive(listen_s))
    return ReceivedAt(bit_rate, frames, bus.error_frame_count() - errors)


@contextmanager
def _listening(session: SessionNodes, *, listen_only: bool) -> Iterator[tuple[CanopenBus, Sequence[int]]]:
    """Open a bus for listening, with the bit rates it supports."""
    if session.is_open or session.options.sim:
        with _lent(session, listen_only=listen_only) as bus:
            yield bus, ORDER
        return
    from dvtcli.operations.session.bus_of_options import listening_bus

    session.require_settings()
    bus = listening_bus(session.base, ORDER[0], listen_only=listen_only)
    try:
        bus.require_settable(ORDER[0], listen_only=listen_only)
        rates: Sequence[int] = ORDER
    except SafetyRefusal:  # it listens as it is, and somebody else sets it
        rates = (bus.runs_at,) if bus.runs_at else ()
    try:
        yield bus, rates
    finally:
        bus.close()


@contextmanager
def _lent(session: SessionNodes, *, listen_only: bool) -> Iterator[CanopenBus]:
    """Use the open bus, and restore its bit rate."""
    bus = session.open_network().bus
    bus.require_settable(ORDER[0], listen_only=listen_only)
    before = bus.runs_at
    if before is None:
        raise SafetyRefusal(
            f"the bit rate of {bus.name} is not known, so that it could not be set back",
            hint=Hint(Action.LISTEN_BIT_RATE, why="exit, then {}")
            + Hint(Action.GIVE_BIT_RATE, why="or open it with {}"),
        )
    try:
        bus.set_bit_rate(before, listen_only=listen_only)
        yield bus
    finally:
        bus.set_bit_rate(before)
        bus.disturbances()  # what was noticed at wrong bit rates is no news
