"""Watch the bus, decoded by the nodes' mappings and a DBC file. Only reads."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from time import monotonic
from typing import TYPE_CHECKING

from dvtcli.errors import BusUnavailable
from dvtcli.operations.frames.explain_frame import frame_seen
from dvtcli.operations.frames.layouts import live_decoder, live_decoders, open_wire
from dvtcli.operations.network.described_nodes import described_nodes
from dvtcli.operations.session.steady_listener import SteadyListener
from dvtcli.watch.decoder import Decoder, Layout, Misfits
from dvtcli.watch.frame_reader import FrameReader
from dvtcli.watch.seen import FrameStore

if TYPE_CHECKING:
    from dvtcli.domain.ports import Frame
    from dvtcli.operations.results import FrameSeen
    from dvtcli.operations.session.open_network import OnBusEvent
    from dvtcli.operations.session.session import Session


#: how long frames are gathered before they are handed on (s)
BATCH_S = 0.05


class ListeningTime:
    """*duration_s* seconds from *began_s* on (None: from now on), None for ever, by the clock *now_s* (s)."""

    def __init__(
        self, duration_s: float | None, now_s: Callable[[], float] = monotonic, began_s: float | None = None
    ) -> None:
        self._now_s = now_s
        self._until_s = None if duration_s is None else (now_s() if began_s is None else began_s) + duration_s

    def is_over(self) -> bool:
        """Tell whether the time is over."""
        return self._until_s is not None and self._now_s() >= self._until_s

    @property
    def batch_s(self) -> float:
        """How long to wait for the next frames (s): no longer than is left."""
        return BATCH_S if self._until_s is None else min(BATCH_S, max(0.0, self._until_s - self._now_s()))


@dataclass(slots=True)
class Watched:
    """A bus that is listened to, with the *decoder* for *nodes* and the file *dbc*; see `layouts.live_decoder`."""

    session: Session
    nodes: tuple[int, ...]
    dbc: str | None
    listener: SteadyListener
    decoder: Decoder

    @property
    def bitrate(self) -> int | None:
        """The bus's bit rate (bit/s), None if unknown or meaningless."""
        wire = self.session.wire
        return None if wire.simulated else wire.bitrate

    def layout(self, frame: Frame) -> Layout:
        """Return the layout of *frame*; it may change after a loss of the bus."""
        return self.decoder.layout(frame)

    def decoders(self) -> Iterator[tuple[int | None, Decoder]]:
        """Read the nodes' mappings and names, node by node; see `layouts.live_decoders`."""
        yield from live_decoders(self.session, self.nodes, self.dbc, named=True)

    def come_back(
        self, failed: BusUnavailable, stopping: Callable[[], bool], on_bus_event: OnBusEvent | None = None
    ) -> bool:
        """Wait for the bus, which *failed*, and read mappings again; False as soon as *stopping*().

        Raises *failed* if waiting is not allowed.
        """
        while self.listener.come_back(failed, stopping, on_bus_event):
            try:
                self.decoder = live_decoder(self.session, self.nodes, self.dbc)
            except BusUnavailable as again:
                failed = again
            else:
                return True
        return False


@contextmanager
def watching(
    session: Session, nodes: tuple[int, ...] = (), dbc: str | None = None, *, known: bool = True
) -> Iterator[Watched]:
    """Watch the bus from now on, across loss and return; *known*: with mappings, read first."""
    open_wire(session)
    decoder = live_decoder(session, nodes, dbc) if known else Decoder()
    with SteadyListener(session, unasked=True) as listener:
        yield Watched(session, nodes, dbc, listener, decoder)


def stream(
    watched: Watched,
    show: Callable[[Iterable[FrameSeen]], None],
    text: str = "",
    duration_s: float | None = None,
    *,
    changes: bool = False,
    only: frozenset[str] = frozenset(),
    on_bus_event: OnBusEvent | None = None,
) -> None:
    """Show frames with *text* (lower case) in a name for *duration_s* seconds (None: forever).

    *changes* shows only new values, *only* frames of these kinds, as in `typed_frame.READ_KINDS` (none: all). Lost
    frames are reported at the end. *on_bus_event* gets loss and return of the bus; raises BusUnavailable if it is not
    waited for, or not back in time.
    """
    listener, store, time = watched.listener, FrameStore(watched.decoder), ListeningTime(duration_s)
    misfits = Misfits(watched.layout, watched.session.reporter.warning)
    reader = FrameReader(watched.decoder, described_nodes(watched.session, watched.dbc))
    try:
        while not time.is_over():
            try:
                taken = listener.take(time.batch_s)
            except BusUnavailable as failed:
                if not watched.come_back(failed, time.is_over, on_bus_event):
                    raise
                store = FrameStore(watched.decoder)
                reader.know(watched.decoder)
                continue
            read = [(frame, reader.read(frame)) for frame in misfits.passing(taken)]
            if changes:
                read = [(frame, reading) for frame, reading in read if store.take(frame, reading)]
            seen = (
                frame_seen(frame, watched.decoder, reading)
                for frame, reading in read
                if not only or reading.is_one_of(only)
            )
            show((seen_frame.chosen(text) for seen_frame in seen if seen_frame.matches(text)) if text else seen)
    finally:
        listener.tell_overflow()
