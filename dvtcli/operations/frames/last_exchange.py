"""The last exchange as frames, transmitted and received. Sends nothing.

A run without an exchange shows that of the last failed run (`kept_exchange`).
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Sequence
from contextlib import suppress
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.device.change.private_file import open_private, private_folder, unreadable
from dvtcli.domain.can_ids import SDO_REQUEST_BASE, SDO_RESPONSE_BASE
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.ports import Frame
from dvtcli.domain.typed_frame import frame_text, typed_frame
from dvtcli.errors import SafetyRefusal, UsageError
from dvtcli.files.user_folders import user_folder

if TYPE_CHECKING:
    from dvtcli.operations.results.frames import Traced
    from dvtcli.operations.session.session import SessionNodes
    from dvtcli.operations.user.session_user import SessionUser


#: replaces the value of a passcode's frame
LEFT_OUT = " (value not kept)"
_ARROWS = {"->": True, "<-": False}
#: 1024 frames, each a short line
_LONGEST = 256 * 1024


def keep_exchange(lines: Sequence[str]) -> bool:
    """Save *lines* instead of older lines; returns whether it did. A full disk is not reported."""
    if not lines:
        return False
    try:
        private_folder(_file().parent)
        descriptor, path = tempfile.mkstemp(prefix="last-exchange-", dir=_file().parent)  # 0600
        try:
            with os.fdopen(descriptor, "w", encoding="ascii") as file:
                file.writelines(f"{line}\n" for line in lines)
            Path(path).replace(_file())
        except BaseException:
            Path(path).unlink(missing_ok=True)
            raise
    except (OSError, SafetyRefusal):
        return False
    return True


def kept_exchange() -> list[tuple[Frame, bool, bool]]:
    """Load the saved frames, each with whether it was ours and whether its value was left out; empty if damaged.

    Raises SafetyRefusal or OSError if unreadable.
    """
    if (unread := unreadable(_file().parent)) is not None:
        raise unread
    with suppress(FileNotFoundError, ValueError):
        descriptor = open_private(_file(), os.O_RDONLY)
        with os.fdopen(descriptor, encoding="ascii") as file:
            return [_frame(line) for line in file.read(_LONGEST).splitlines()]
    return []


def _file() -> Path:
    return user_folder("state") / "last-exchange.txt"


def _frame(line: str) -> tuple[Frame, bool, bool]:
    """Parse a line of `exchange_text`; raises ValueError if invalid."""
    time, arrow, said = line.split(" ", 2)
    if arrow not in _ARROWS:
        raise ValueError(f"{arrow!r} is not an arrow")
    frame = typed_frame(said.removesuffix(LEFT_OUT))
    at_s = datetime.fromisoformat(time.replace("Z", "+00:00")).timestamp()
    return frame._replace(timestamp_s=at_s), _ARROWS[arrow], said.endswith(LEFT_OUT)


#: default number of frames
_SHOWN = 32
#: SDO command specifiers (CiA 301, 7.2.4.3): to begin a download, to begin one by blocks, and to abort
_DOWNLOAD, _BLOCK_DOWNLOAD, _ABORT = 1, 6, 4


def trace_last(session: SessionNodes, count: int | None = None, only: frozenset[str] = frozenset()) -> Traced:
    """Explain the last *count* frames exchanged on the session's bus.

    None: 32, or all from the last write that a node refused or did not answer. Without an exchange, those of the last
    failed run. *only* are kinds of frames, as in `typed_frame.READ_KINDS`; none: all. The values of passcodes are left
    out. Raises UsageError if nothing was exchanged.
    """
    from dvtcli.operations.frames.explain_frame import explained
    from dvtcli.operations.network.described_nodes import described_nodes
    from dvtcli.operations.results.frames import Traced, TracedFrame
    from dvtcli.watch.decoder import Decoder
    from dvtcli.watch.frame_reader import FrameReader

    exchanged = _exchanged(session) or _of_a_failed_run(session)
    wanted = _count_of_refusal(exchanged) if count is None else count
    reader = FrameReader(Decoder(), described_nodes(session))
    frames = []
    for number, (frame, sent, secret) in enumerate(exchanged):
        if number < len(exchanged) - wanted and (not only or count is None):
            reader.read(frame)  # a transfer may have begun before
            continue
        seen = explained(frame, reader)
        if not only or seen.reading.is_one_of(only):
            frames.append(TracedFrame(seen, sent, secret))
    if not frames:
        session.reporter.note(f"no frame of the last exchange is of the kinds {', '.join(sorted(only))}")
    return Traced(tuple(frames[-wanted:]))


def _count_of_refusal(exchanged: Sequence[tuple[Frame, bool, bool]]) -> int:
    """Return how many frames of *exchanged* reach back to the last refused write."""
    open_at: dict[int, tuple[int, bytes]] = {}
    refused: list[int] = []
    for number, (frame, sent, _) in enumerate(exchanged):
        node_id, specifier = frame.can_id & 0x7F, frame.data[0] >> 5 if len(frame.data) == 8 else None
        if specifier is not None and sent and frame.can_id & ~0x7F == SDO_REQUEST_BASE:
            refused += [at for at, _ in [open_at.pop(node_id)]] if node_id in open_at else []
            if specifier == _DOWNLOAD or (specifier == _BLOCK_DOWNLOAD and not frame.data[0] & 1):
                open_at[node_id] = number, frame.data[1:4]
        elif specifier is not None and not sent and frame.can_id & ~0x7F == SDO_RESPONSE_BASE and node_id in open_at:
            at, place = open_at[node_id]
            if frame.data[1:4] == place:
                refused += [at] if specifier == _ABORT else []
                del open_at[node_id]
    last = max((*refused, *(at for at, _ in open_at.values())), default=len(exchanged))
    return max(_SHOWN, len(exchanged) - last)


def _of_a_failed_run(session: SessionUser) -> list[tuple[Frame, bool, bool]]:
    from dvtcli.domain.times import utc

    try:
        kept = kept_exchange()
    except (OSError, SafetyRefusal) as unread:
        raise UsageError(
            "nothing was exchanged yet, and what is kept of a run that failed cannot be read",
            why=str(unread),
            hint=unread.hint if isinstance(unread, SafetyRefusal) else None,
        ) from unread
    if not kept:
        raise UsageError(
            "nothing was exchanged yet, and no exchange of a run that failed is kept",
            hint=Hint(
                Action.SHOW_FRAMES,
                why="at the prompt, or in a script, after the line it is about; {} shows the frames of one command",
            ),
        )
    session.reporter.note(f"the last exchange of a failed run, which ended at {utc(kept[-1][0].timestamp_s)}")
    return kept


def exchange_text(session: SessionNodes) -> list[str]:
    """Return the last exchange as text for a file, a line per frame; empty if there was none."""
    from dvtcli.domain.times import utc

    return [
        f"{utc(frame.timestamp_s)} {'->' if sent else '<-'} {frame_text(frame)}{LEFT_OUT if secret else ''}"
        for frame, sent, secret in _exchanged(session)
    ]


def _exchanged(session: SessionNodes) -> list[tuple[Frame, bool, bool]]:
    """Return the frames without passcodes, each with whether it is ours and whether its value was left out."""
    if not session.is_open:
        return []
    secret = session.secrets.in_frames(unknown=True)
    found = []
    for frame, sent in session.open_network().bus.exchanged():
        told, is_secret = secret.without(frame)
        found.append((told, sent, is_secret))
    return found
