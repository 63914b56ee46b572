"""Report what no command expects: a bug in dvtcli, its traceback in a private file; results that stdout refuses."""

from __future__ import annotations

import os
import sys
import tempfile
import traceback
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.device.change.private_file import private_folder
from dvtcli.errors import Bug, ResultsLost, SafetyRefusal
from dvtcli.files.user_folders import user_folder

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation
    from dvtcli.operations.session.session import SessionNodes


def bug_error(bug: BaseException, frames: Sequence[str], *, is_open: bool) -> Bug:
    """Convert *bug* to an error; saves its traceback and the last *frames* to a file if possible.

    *is_open*: whether the bus was opened, so that something may have been sent.
    """
    text = f"a bug in dvtcli: {type(bug).__name__}: {bug}"
    try:
        hint = f"please report it with {keep(bug, frames)}"
    except OSError as failed:
        hint = f"please report it; its traceback cannot be kept: {failed.strerror}"
    if is_open:
        return Bug(text, hint=hint, state="unknown")
    unsent = Bug(text, hint=hint)
    unsent.state_text = "unchanged: nothing was sent"
    return unsent


def keep(bug: BaseException, frames: Sequence[str] = ()) -> str:
    """Write the traceback of *bug* to `crash/` of the state folder, else the system's; returns the path.

    *frames*, the last frames exchanged, follow the traceback.
    """
    state = user_folder("state")
    try:
        private_folder(state)
        private_folder(state / "crash")
        return _written(bug, frames, state / "crash")
    except (OSError, SafetyRefusal):  # a state folder that cannot be used must not hide what went wrong
        return _written(bug, frames, None)


def _written(bug: BaseException, frames: Sequence[str], folder: Path | None) -> str:
    """Write to a new file of *folder* with an unpredictable name, against planted files."""
    stamp = datetime.now(UTC).strftime("%Y%m%dT%H%M%SZ")
    descriptor, path = tempfile.mkstemp(prefix=f"dvtcli-crash-{stamp}-", suffix=".txt", dir=folder)  # 0600
    with os.fdopen(descriptor, "w", encoding="utf-8") as file:
        traceback.print_exception(bug, file=file)
        file.writelines(f"{line}\n" for line in (["", "The last exchange:", *frames] if frames else []))
    return path


def last_exchange(session: SessionNodes) -> list[str]:
    """Return the last frames as text; a note if *session* fails to provide them."""
    from dvtcli.operations.frames.last_exchange import exchange_text

    try:
        return exchange_text(session)
    except Exception as second:  # noqa: BLE001 - the bug itself is the news
        return [f"not known: {type(second).__name__}: {second}"]


def report_lost_results(session: Conversation, failed: OSError) -> int:
    """Report on stderr that results, also documents, are lost because stdout accepts no more."""
    from dvtcli.cli.view.streams import silence

    silence(sys.stdout)
    state, said = session.state_now()
    lost = ResultsLost(f"the results cannot be written: {failed.strerror}", state=state)
    lost.state_text = said
    lost.stays = session.staying()
    if session.made:
        from dvtcli.domain.text import join_some

        lost.details.append(("made", join_some(session.made)))
        lost.state_text = said or ("unchanged: nothing was written to a node" if state == "unchanged" else None)
    session.output.error(lost, session.place, readable=True)
    return lost.exit_code
