"""Get a passcode from the environment, the settings file, or a question without echo; never store it.

Never from a command line, visible in shell histories and process lists.
"""

from __future__ import annotations

import os
import sys
from typing import TYPE_CHECKING, TextIO

from dvtcli.domain.datatypes import parse_number
from dvtcli.domain.hint import Action, Hint
from dvtcli.errors import SafetyRefusal, UsageError

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation
    from dvtcli.operations.session.session import SessionNodes
    from dvtcli.operations.user.settings import File

VARIABLE = "DVTCLI_PASSCODE"
_SOURCES = f"{VARIABLE} in the environment, or `passcode` in your config.toml (`doctor` shows its path)"


def passcode(session: Conversation, node_id: int, level: int) -> int:
    """Return the passcode (0..0xFFFF) for *level* of a node. Raises SafetyRefusal if nobody can be asked."""
    if session.dry_run:
        return 1  # a twin believes any, and none is spent on it
    project = session.settings.project_bus()
    if project is not None:
        _agreed(session, project, node_id)
    if given := os.environ.get(VARIABLE):
        return _number(given, f"{VARIABLE} in the environment")
    if (kept := session.settings.passcode) is not None:
        return _number(kept, "`passcode` in your config.toml")
    if session.in_script or not (sys.stdin.isatty() and sys.stderr.isatty()):
        raise SafetyRefusal(
            f"no terminal to ask for the passcode of node {node_id}", node=node_id, hint=f"give it as {_SOURCES}"
        )
    return _number(
        _asked(session.output.stderr, f"passcode of node {node_id} for level {level}: ", node_id), "the passcode"
    )


def _agreed(session: SessionNodes, project: File, node_id: int) -> None:
    """Raise SafetyRefusal unless the user agrees to send a passcode on the *project* file's bus; no option agrees."""
    from dvtcli.bus.python_can_settings import is_network

    bus = session.bus.name
    options = session.options
    if not project.trusted and is_network(options.interface, options.channel, options.adapter_settings):
        raise SafetyRefusal(
            f"no passcode is sent on {bus}, a network that {project.path} chose, which is not trusted",
            node=node_id,
            hint=Hint(Action.TRUST, why="after you have checked the file; or choose the bus yourself")
            + Hint(Action.GIVE_INTERFACE, why="as in {}"),
        )
    question = f"{project.path} sets the bus {bus}: send the passcode of node {node_id} to it?"
    session.require_yes(question, node_id, Hint(Action.GIVE_INTERFACE, why="{} chooses the bus"), "not logged in")


def _asked(stderr: TextIO, question: str, node_id: int) -> str:
    import warnings
    from getpass import GetPassWarning, getpass

    with warnings.catch_warnings():
        warnings.simplefilter("error", GetPassWarning)
        try:
            return getpass(question, stderr)
        except KeyboardInterrupt:
            stderr.write("\n")  # what is said next begins a line
            raise
        except (GetPassWarning, EOFError) as failed:
            stderr.write("\n")
            why = None if isinstance(failed, EOFError) else "this terminal cannot hide typed characters"
            raise SafetyRefusal(
                "not logged in: no passcode was given",
                node=node_id,
                why=why,
                hint=f"enter it, or give it as {_SOURCES}",
            ) from None


def _number(text: str, where: str) -> int:
    """Return the number in *text*; errors never quote *text*, possibly nearly right."""
    try:
        value = parse_number(text.strip())
    except ValueError:
        value = -1
    if not 0 < value <= 0xFFFF:
        raise UsageError(f"{where}: a passcode is a number 1…65535, decimal or 0x… in hexadecimal") from None
    return value
