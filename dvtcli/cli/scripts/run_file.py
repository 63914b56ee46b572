"""A script is run by its file's name: a FILE.tcl by Tcl, any other line by line, `-` from stdin."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from dvtcli.cli.scripts.script import run_script
from dvtcli.cli.scripts.script_parse import MOST_BYTES
from dvtcli.errors import UsageError
from dvtcli.files.input_file import read_input_head

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation


def run_file(
    session: Conversation,
    file: str,
    *,
    keep_going: bool = False,
    atomic: bool = False,
    most_seconds: float | None = None,
) -> int:
    """Run the script *file* (`-`: stdin); returns the exit code. Raises UsageError if unreadable."""
    if file == "-":
        return run_script(
            session, sys.stdin.buffer.read(MOST_BYTES + 1), "<stdin>", keep_going=keep_going, atomic=atomic
        )
    try:
        data = read_input_head(file, MOST_BYTES + 1)
    except OSError as failed:
        raise UsageError(f"{file}: {failed.strerror}", place=file, hint="run takes the path of a script") from failed
    if file.lower().endswith(".tcl"):
        from dvtcli.cli.dvt.tcl_script import run_tcl

        if atomic:
            raise UsageError("--atomic is for .dvt scripts: the changes of a Tcl script are not known before it runs")
        return run_tcl(session, data, file, keep_going=keep_going, most_seconds=most_seconds)
    return run_script(session, data, file, keep_going=keep_going, atomic=atomic)
