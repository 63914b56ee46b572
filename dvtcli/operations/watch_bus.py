"""What is on the bus, as it passes, with what the nodes' mappings and a DBC file say of it. Only reads."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from time import monotonic
from typing import TYPE_CHECKING

from dvtcli.operations.frame_answer import frame_seen
from dvtcli.operations.layouts import live_decoder, open_wire
from dvtcli.watch.listener import Listener
from dvtcli.watch.seen import FrameStore

if TYPE_CHECKING:
    from dvtcli.operations.results import FrameSeen
    from dvtcli.operations.session import Session
    from dvtcli.watch.decoder import Decoder

#: how long frames are gathered before they are shown (s)
_BATCH_S = 0.05


@contextmanager
def watching(
    session: Session, nodes: tuple[int, ...] = (), dbc: str | None = None
) -> Iterator[tuple[Listener, Decoder]]:
    """Listen to the bus from now on, with the decoder for *nodes* and the DBC file; see `layouts.live_decoder`."""
    bus = open_wire(session)
    decoder = live_decoder(session, nodes, dbc)
    with Listener(bus, session.secrets.in_frame) as listener:
        yield listener, decoder


def stream(
    session: Session,
    listener: Listener,
    decoder: Decoder,
    show: Callable[[Iterable[FrameSeen]], None],
    text: str = "",
    duration_s: float | None = None,
    *,
    changes: bool = False,
) -> None:
    """Show each frame that has *text* (small letters) in its names, for *duration_s* seconds, None for ever.

    With *changes* only what says something new. The drops are said at the end, however it comes.
    """
    store = FrameStore(decoder)
    until_s = None if duration_s is None else monotonic() + duration_s
    try:
        while until_s is None or monotonic() < until_s:
            left_s = _BATCH_S if until_s is None else min(_BATCH_S, max(0.0, until_s - monotonic()))
            fresh = [frame for frame in listener.take(left_s) if store.take(frame) or not changes]
            seen = [frame_seen(frame, decoder) for frame in fresh]
            show(one for one in seen if one.matches(text))
    finally:
        if listener.overflowed:
            session.tell.warning(f"{listener.overflowed} frames were dropped: they came faster than they were written")
