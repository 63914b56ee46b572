"""The last exchange as frames: those that were sent here, and those that answered them. Sends nothing.

Of a run without an exchange of its own it is that of the last one that failed (`kept_exchange`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.errors import UsageError

if TYPE_CHECKING:
    from dvtcli.domain.ports import Frame
    from dvtcli.operations.results.explained import Traced
    from dvtcli.operations.session.session import Session


def trace_last(session: Session, count: int) -> Traced:
    """The last *count* frames of what was exchanged on the session's bus, each explained.

    Where nothing was, they are those of the last run that failed. The value of a passcode is left out. UsageError where
    there are none either.
    """
    from dvtcli.operations.frames.explain_frame import described_nodes, explained
    from dvtcli.operations.results.explained import Traced, TracedFrame
    from dvtcli.watch.decoder import Decoder

    found = (_exchanged(session) or _of_a_failed_run(session))[-count:]
    decoder, described = Decoder(), described_nodes(session)
    frames = (TracedFrame(explained(frame, decoder, described), sent, secret) for frame, sent, secret in found)
    return Traced(tuple(frames))


def _of_a_failed_run(session: Session) -> list[tuple[Frame, bool, bool]]:
    from dvtcli.domain.wall_clock import utc
    from dvtcli.operations.frames.kept_exchange import kept_exchange

    kept = kept_exchange()
    if not kept:
        raise UsageError(
            "nothing was exchanged yet, and no exchange of a run that failed is kept",
            hint="at the prompt, or in a script, behind the line it is about; -vv shows the frames of one command",
        )
    session.tell.note(f"the last exchange of a run that failed, which ended at {utc(kept[-1][0].timestamp_s)}")
    return kept


def exchange_text(session: Session) -> list[str]:
    """The same as text for a file, a line a frame; empty where nothing was exchanged."""
    from dvtcli.domain.typed_frame import frame_text
    from dvtcli.domain.wall_clock import utc
    from dvtcli.operations.frames.kept_exchange import LEFT_OUT

    return [
        f"{utc(frame.timestamp_s)} {'->' if sent else '<-'} {frame_text(frame)}{LEFT_OUT if secret else ''}"
        for frame, sent, secret in _exchanged(session)
    ]


def _exchanged(session: Session) -> list[tuple[Frame, bool, bool]]:
    """Each frame without a passcode in it, whether it is ours, and whether something was left out."""
    if not session.is_open:
        return []
    secret = session.secrets.in_frames(unknown=True)
    found = []
    for frame, sent in session.open_network().bus.exchanged():
        told, is_secret = secret.without(frame)
        found.append((told, sent, is_secret))
    return found
