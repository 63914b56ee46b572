"""The first start without a configured bus: offer this machine's interfaces, and save the choice on request."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.cli.view.lines import Cell, Line, Table
from dvtcli.cli.view.typed_hints import error_text, typed
from dvtcli.device.cancellation import INTERRUPTED
from dvtcli.errors import InputFileError, UsageError
from dvtcli.operations.user.change_settings import trust_settings
from dvtcli.operations.user.options import bit_rate
from dvtcli.operations.user.settings import NAME, why_unusable

if TYPE_CHECKING:
    from dvtcli.bus.discover import FoundInterface
    from dvtcli.cli.conversation import Conversation

#: the simulated node for first trials
SIMULATED = "generic"
#: the most common bit rate of CANopen networks (bit/s)
USUAL_BIT_RATE = 500_000

Choice = dict[str, str | int | list[str]]


def first_start(session: Conversation) -> None:
    """Let the user choose and open an interface if none is configured; otherwise return at once.

    Also returns if nobody can answer: opening the bus then reports the cause.
    """
    options = session.options
    if options.sim or options.interface or options.channel or not sys.stderr.isatty() or session.output.json:
        return
    from dvtcli.bus.discover import find_interfaces
    from dvtcli.bus.python_can_settings import is_configured
    from dvtcli.domain.text import join_some

    if is_configured():
        return
    session.output.lines(["No CAN interface is configured. Searching this machine for CAN interfaces …"])
    found, unanswered = find_interfaces()
    if unanswered:
        session.output.warning(f"adapters are unknown: no answer from {join_some(unanswered)}")
    choice = _choose(session, found)
    if choice is None:
        return
    given = {key: tuple(value) if isinstance(value, list) else value for key, value in choice.items()}
    session.start(given, "the choice at the start")
    _ = session.network  # opened before it is kept: what does not open is no default
    _keep(session, choice)


def _choose(session: Conversation, found: list[FoundInterface]) -> Choice | None:
    """Return the user's choice, None if the terminal is gone."""
    session.output.lines(_offer(found))
    usual = next((number for number, one in enumerate(found, 1) if one.problem is None), len(found) + 1)
    while True:
        answer = _answer(session, f"Use which? [{usual}]")
        if answer is None:
            return None
        number = usual if answer == "" else int(answer) if answer.isdecimal() and answer.isascii() else 0
        if 1 <= number <= len(found) + 1:
            break
        session.output.lines([f"{f'1 to {len(found) + 1}' if found else 'only 1'}, please, or Ctrl-C to leave"])
    if number == len(found) + 1:
        return {"sim": [SIMULATED]}
    return _bus(session, found[number - 1])


def _offer(found: list[FoundInterface]) -> list[Line]:
    """Return the numbered list, with remedies for unusable interfaces."""
    table = Table(indent=2)
    for number, one in enumerate(found, 1):
        table.add(str(number), one.interface, one.channel, Cell(one.problem or one.about, "yellow" * bool(one.problem)))
    table.add(str(len(found) + 1), "simulated", SIMULATED, "a node in this program (no hardware)")
    head = (
        "Found:"
        if found
        else "No CAN interface found. Check that the adapter is connected and its driver installed (dvtcli doctor)"
    )
    return [head, *table.lines()]


def _bus(session: Conversation, chosen: FoundInterface) -> Choice | None:
    """The options for *chosen*; a SocketCAN link has its bit rate already, others are asked for."""
    choice: Choice = {"interface": chosen.interface, "channel": chosen.channel}
    while chosen.interface != "socketcan":
        answer = _answer(session, f"Bit rate of the network in bit/s? [{USUAL_BIT_RATE}]")
        if answer is None:
            return None
        try:
            choice["bitrate"] = bit_rate(answer or USUAL_BIT_RATE)
            break
        except UsageError as wrong:
            session.output.lines([wrong.text, "125k, 250k, 500k and 1M are usual"])
    return choice


def _answer(session: Conversation, question: str) -> str | None:
    """The line typed in answer, None at the terminal's end."""
    session.output.stderr.write(f"{question} ")
    session.output.stderr.flush()
    line = sys.stdin.readline()
    return line.strip() if line else None


def _keep(session: Conversation, choice: Choice) -> None:
    """Save *choice* to the settings file on request; a failure does not prevent its use."""
    from dvtcli.files.settings_file import save_settings

    project = session.settings.project
    path = Path(project.path if project is not None and Path(project.path).is_file() else NAME)
    try:
        if not session.output.ask(f"Save as default in {path}?"):
            return
    except KeyboardInterrupt:
        if session.cancellation.exit_code != INTERRUPTED:
            raise
        return  # Ctrl-C at a question is a no
    try:
        save_settings(path, choice)
    except InputFileError as failed:
        session.output.warning(error_text(failed))
        return
    refused = why_unusable(str(path))
    if refused is not None:
        session.output.warning(f"{path} will not be used: {refused.text}; {typed(refused.hint)}")
        return
    if project is None or project.trusted:
        trust_settings(str(path))  # all of it is the user's own choice
    session.output.note(f"{path} chooses it from now on; -i, -c or --sim on the command line override it")
