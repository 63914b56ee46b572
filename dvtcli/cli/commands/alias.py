"""List, set or remove your own words for lines of the prompt."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand, Effect
from dvtcli.cli.params import TEXT
from dvtcli.errors import UsageError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dvtcli.cli.conversation import Conversation
    from dvtcli.operations.results import Facts
    from dvtcli.operations.user.settings import Settings


@click.command(
    "alias",
    cls=DvtCommand,
    short_help=__doc__,
    effect=Effect.NONE,
    context_settings={"allow_interspersed_args": False},
)
@click.argument("words", type=TEXT, nargs=-1, metavar="[NAME = [LINE]]")
@click.pass_obj
def command(session: Conversation, /, words: tuple[str, ...]) -> Facts:
    """List the aliases of the prompt, or set NAME to the beginning of a LINE, or remove NAME.

    They are kept in [aliases] of your own settings file. Options come before NAME. A LINE with | or > stands in quotes.

    \b
    alias
    alias v = read velocity_actual_value
    alias fast = map tpdo1 6041 606C --sync 1
    alias on = "pdo --all | grep -v off"
    alias v =                  remove it
    """
    from dvtcli.cli.prompt.line import usable_aliases
    from dvtcli.operations.user.change_settings import list_aliases, set_alias

    if not words:
        settings = _settings(session)
        return list_aliases(settings, usable_aliases(settings))
    name, line = _name_and_line(words)
    _require_usable(session, name, line)
    answer = set_alias(name, line, dry_run=session.dry_run)
    if session.at_prompt:
        session.aliases.clear()
        session.aliases.update(usable_aliases(_settings(session)))
    return answer


def _settings(session: Conversation) -> Settings:
    """Return the settings, at the prompt as they are now: an earlier line may have set an alias."""
    from dvtcli.operations.user.settings import Settings

    if not session.at_prompt:
        return session.settings
    settings = Settings()
    settings.read_files()
    return settings


def _name_and_line(words: Sequence[str]) -> tuple[str, str | None]:
    """Split `NAME = LINE`, also without blanks at the sign; the line is None if empty. Raises UsageError otherwise."""
    from dvtcli.cli.prompt.line import quoted

    name, sign, first = words[0].partition("=")
    rest = list(words[1:])
    if not sign:
        if not rest or not rest[0].startswith("="):
            raise click.UsageError("an alias is set by: alias NAME = LINE, and removed by: alias NAME =")
        first = rest.pop(0).removeprefix("=")
    line = [first, *rest] if first else rest
    if not line:
        return name, None
    return name, line[0] if len(line) == 1 else " ".join(map(quoted, line))


def _require_usable(session: Conversation, name: str, line: str | None) -> None:
    """Raise UsageError for the name of a command, or a line that may have a passcode."""
    from dvtcli.cli.catalogue import command_names

    if line is None:
        return
    if name.lower() in command_names():
        raise UsageError(f"{name!r} is a command already", hint="give the alias another name")
    if session.is_secret(line):
        raise UsageError("a line that may have a passcode is not saved")
