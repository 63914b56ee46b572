"""Transmit frames at their times: counted, timed, and delayed if the bus is too busy.

The caller has asked for consent.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from dvtcli.bus.bus_share import ShareLimiter
from dvtcli.bus.watched_bus import DEFAULT_SHARE_PERCENT
from dvtcli.domain.can_ids import NMT_ID
from dvtcli.domain.nmt import NmtCommand, NmtState
from dvtcli.domain.text import plural
from dvtcli.errors import DvtcliError
from dvtcli.operations.results.frames import NO_END, Outcome
from dvtcli.watch.statistics import Lateness

if TYPE_CHECKING:
    from dvtcli.device.cancellation import Cancellation
    from dvtcli.domain.ports import Frame
    from dvtcli.operations.session.session import Session, SessionNodes

#: how long is waited in one go (s): how long a Ctrl-C is not seen
_TICK_S = 0.05
#: how long the controller may take to complain of the last frame (s)
_SETTLE_S = 0.05
#: interval of checks for a running machine (s)
_LOOK_S = 0.1
_ALL = 100


def put_on_bus(
    session: Session,
    due: Iterable[tuple[float | None, Frame]],
    wanted: int,
    *,
    always_share: bool = False,
    cancellation: Cancellation | None = None,
) -> Outcome:
    """Transmit each of *due* at its time (s from now; None: at once); *wanted* is their number.

    Ends with the last frame, on *cancellation* (None: the session's), or when the bus or *due* fails. While a node is,
    or may be, OPERATIONAL, or always with *always_share*, the load stays within --bus-share (50 %) if the bit rate is
    known.
    """
    cancellation = cancellation or session.cancellation
    putting = _Putting(session, cancellation, always_share=always_share)
    told_s = began_s = putting.bus.now_s()
    errors = putting.bus.error_frame_count()
    with cancellation.deferred():
        try:
            for due_s, frame in due:
                if not putting.put(frame, None if due_s is None else began_s + due_s):
                    break
                if putting.last_s - told_s >= 1:
                    told_s = putting.last_s
                    session.reporter.progress(*_progress(putting.sent, wanted))
            ended_s = putting.last_s
            putting.bus.sleep(_SETTLE_S)
        except DvtcliError as failed:
            putting.failure, ended_s = failed, putting.last_s
        finally:
            putting.close()
    for node in session.met_nodes():  # whatever was read of it may be old, its state, too
        (node.commanded if putting.commanded else node.read_anew)()
    cancelled = cancellation.requested and putting.sent < wanted
    return Outcome(
        wanted, putting.sent, max(0.0, ended_s - putting.first_s), putting.late.most_s, putting.late.nearly_all_s(),
        error_frames=putting.bus.error_frame_count() - errors, failure=putting.failure,
        interrupted=cancellation.exit_code if cancelled else 0,
    )  # fmt: skip


def _progress(sent: int, wanted: int) -> tuple[str, int, int]:
    """Describe the progress for `Reporter.progress`; no total without an end."""
    if wanted >= NO_END:
        return f"{plural(sent, 'frame')} sent", sent, 0
    return f"{sent} of {wanted} frames sent", sent, wanted


class _Putting:
    """Frames being transmitted, and their outcome."""

    def __init__(self, session: SessionNodes, cancellation: Cancellation, *, always_share: bool) -> None:
        self.bus = session.open_network().bus
        self.sent, self.late = 0, Lateness()
        self.first_s = self.last_s = self.bus.now_s()
        self.failure: DvtcliError | None = None
        #: whether an NMT command was among them
        self.commanded = False
        self._met = set(session.seen_nodes())
        self._cancellation = cancellation
        self._always = always_share
        self._percent = session.options.bus_share or DEFAULT_SHARE_PERCENT
        self._share = None if self.bus.bitrate is None else ShareLimiter(self.bus, self.bus.bitrate)
        self._looked_s, self._runs = float("-inf"), False

    def put(self, frame: Frame, due_s: float | None) -> bool:
        """Transmit *frame* at *due_s* or later; False if cancelled."""
        while due_s is not None and (left_s := due_s - self.bus.now_s()) > 0:
            if self._cancellation.requested:
                return False
            self.bus.sleep(min(left_s, _TICK_S))
        self._keep_share()
        if self._cancellation.requested:
            return False
        now_s = self.bus.now_s()
        self._send(frame)
        self.sent += 1
        self.first_s, self.last_s = now_s if self.sent == 1 else self.first_s, now_s
        if due_s is not None:
            self.late.add(now_s - due_s)
        return True

    def _send(self, frame: Frame) -> None:
        """Send a valid NMT command through the NMT service, so that cached states are dropped."""
        if (
            frame.can_id == NMT_ID and not frame.extended and not frame.remote and len(frame.data) == 2
            and frame.data[0] in set(NmtCommand) and frame.data[1] <= 127
        ):  # fmt: skip
            self.commanded = True
            self.bus.send_nmt(NmtCommand(frame.data[0]), frame.data[1])
        else:
            self.bus.send(frame)

    def _keep_share(self) -> None:
        if self._share is None or self._percent >= _ALL:
            return
        now_s = self.bus.now_s()
        if now_s - self._looked_s >= _LOOK_S:
            self._looked_s = now_s
            received = self.bus.nodes_seen()  # one of which nobody knows the state may run
            self._runs = self._always or NmtState.OPERATIONAL in received.values() or not self._met <= received.keys()
        self._share.wait(self._percent if self._runs else 0)

    def close(self) -> None:
        """Measure the load no longer."""
        if self._share is not None:
            self._share.wait(0)
