"""Send single frames, once or repeated: shown first, with a question if nodes act on them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.text import plural
from dvtcli.domain.typed_frame import frame_text
from dvtcli.errors import UsageError
from dvtcli.operations.frames.explain_frame import KnownParties, explained, parsed_frame
from dvtcli.operations.frames.layouts import open_wire
from dvtcli.operations.network.described_nodes import described_nodes
from dvtcli.operations.results.frames import FramesSent, FrameToSend, Outcome
from dvtcli.watch.decoder import Misfits
from dvtcli.watch.frame_effect import effects
from dvtcli.watch.frame_reader import FrameReader

if TYPE_CHECKING:
    from dvtcli.domain.ports import CanopenBus, Frame
    from dvtcli.domain.sdo_frame import SdoValues
    from dvtcli.operations.session.session import Session, SessionNodes
    from dvtcli.operations.user.session_user import SessionUser

#: default interval between rounds (s)
EVERY_S = 0.1
#: rounds of an endless transmission
_FOREVER = 10**12


def send_frames(
    session: Session,
    texts: Sequence[str],
    every_s: float | None = None,
    for_s: float | None = None,
    count: int | None = None,
    nodes: Sequence[int] = (),
    file: str | None = None,
) -> FramesSent:
    """Send the frames in *texts* once, or repeated by *every_s*, *for_s* (s) and *count*; returns what was sent.

    Each is explained first; asks once if nodes act on a frame: NMT, SYNC, TIME, SDO, LSS, EMCY and heartbeats of nodes,
    and PDOs of *nodes*, of known nodes, or of the network *file*. Raises UsageError for an invalid frame, or if the bus
    does not carry it; SafetyRefusal without consent. A dry run sends nothing.
    """
    frames = [frame_to_send(text) for text in texts]
    rounds = _rounds(every_s, for_s, count)
    often = "" if rounds == 1 else " until Ctrl-C" if rounds == _FOREVER else f" {rounds} times"
    shown = agree_to_send(session, frames, often, nodes, file)
    wanted = rounds * len(frames)
    if session.dry_run:
        return FramesSent(shown, Outcome(wanted), dry_run=True)
    from dvtcli.operations.frames.put_on_bus import put_on_bus

    return FramesSent(shown, put_on_bus(session, _due(frames, rounds, every_s or EVERY_S), wanted))


def agree_to_send(
    session: SessionNodes, frames: Sequence[Frame], often: str = "", nodes: Sequence[int] = (), file: str | None = None
) -> tuple[FrameToSend, ...]:
    """Explain *frames*, and ask once if nodes act on one; *nodes* and *file* as in `send_frames`.

    *often* says in words how often they are sent, empty for once.

    Raises UsageError if the bus does not carry them, SafetyRefusal without consent. Sends nothing but SDO uploads.
    """
    _require_carried(open_wire(session), frames)
    shown = _looked_at(session, frames, nodes, file)
    for send in shown:
        session.reporter.note(f"{send.text}")
    _ask(session, shown, often)
    return shown


def frame_to_send(text: str) -> Frame:
    """Parse a frame to send; an empty frame needs a `#`, as a number alone may lack its data."""
    frame = parsed_frame(text)
    if "#" not in text and len(text.split()) == 1:
        raise UsageError(f"{text.strip()} says no data", hint=f"an empty frame is {frame_text(frame)}")
    return frame


def _rounds(every_s: float | None, for_s: float | None, count: int | None) -> int:
    if for_s is not None and count is not None:
        raise UsageError(
            "a time and a count at once",
            hint=Hint(Action.GIVE, {"for_s": None}, "give {}") + Hint(Action.GIVE, {"count": None}, " or {}"),
        )
    if count is not None:
        return count
    if for_s is not None:
        return max(1, int(for_s / (every_s or EVERY_S) + 1e-9))
    return 1 if every_s is None else _FOREVER


def _require_carried(bus: CanopenBus, frames: Sequence[Frame]) -> None:
    if any(frame.remote for frame in frames) and not bus.carries_remote_frames:
        raise UsageError(
            f"{bus.name} carries no remote frames: it would make data frames of them",
            hint="an interface of this machine carries them",
        )


def _looked_at(
    session: SessionNodes, frames: Sequence[Frame], nodes: Sequence[int], file: str | None
) -> tuple[FrameToSend, ...]:
    """Explain each frame and its effect; unknown nodes are looked for before a frame counts as without effect."""
    known = KnownParties(session, nodes, file)
    if not session.options.yes and not all(effects(frame, known.parties) for frame in frames):
        known.look_around()
    reader = FrameReader(known.decoder, described_nodes(session, file))
    shown, misfits, secret = [], Misfits(known.decoder.layout, session.reporter.warning), _followed(session)
    for frame in frames:
        misfits.look(frame)
        told, is_secret = secret.without(frame)
        one = explained(told, reader)
        shown.append(FrameToSend(one, effects(frame, known.parties), is_secret))
    return tuple(shown)


def _followed(session: SessionNodes) -> SdoValues:
    """Follow open transfers, to find passcodes in the next frames: a transfer may have begun before."""
    secret = session.secrets.in_frames(unknown=True)
    for frame, _ in session.wire.exchanged():
        secret.value_in(frame)
    return secret


def _ask(session: SessionUser, shown: Sequence[FrameToSend], often: str) -> None:
    said = [f"{frame_text(send.explained.frame)}: {send.effects}" for send in shown if send.effects]
    if said:
        frames = "it" if len(shown) == 1 else plural(len(shown), "frame")
        session.consent(f"{'; '.join(dict.fromkeys(said))}; send {frames}{often}?")


def _due(frames: Sequence[Frame], rounds: int, every_s: float) -> Iterator[tuple[float, Frame]]:
    for number in range(rounds):
        for frame in frames:
            yield number * every_s, frame
