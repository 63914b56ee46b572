"""Parse a script and all scripts it runs, before the first line runs."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from dvtcli.cli.boundary import usage_error
from dvtcli.cli.run_line import parse
from dvtcli.cli.scripts.atomic import Reach, is_rehearsal
from dvtcli.cli.scripts.script_lines import MOST_BYTES, ScriptLine, placed, script_lines
from dvtcli.errors import DvtcliError, UsageError
from dvtcli.files.input_file import read_input_head

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation

#: Maximum nesting of scripts.
MOST_NESTED = 20


def all_parsed(
    lines: list[ScriptLine], session: Conversation, sources: list[str], checked: dict[str, Reach], reach: Reach
) -> list[tuple[ScriptLine, click.Context]]:
    """Parse all lines, including scripts run by them, before any runs.

    *sources* is the chain of running scripts, outermost first; *checked* has the effects of files already checked;
    *reach*
    collects the effects of these lines.
    """
    parsed: list[tuple[ScriptLine, click.Context]] = []
    written: set[str] = set()
    for line in lines:
        ctx, place = _parsed(line, session, sources[-1]), f"{sources[-1]}:{line.number}"
        parsed.append((line, ctx))
        reach.line(place, ctx)
        file, into = script_of(ctx), Reach() if is_rehearsal(ctx) else reach
        if ctx.command.name == "save":
            written.add(str(ctx.params.get("file")))
        elif file is None:
            continue
        elif file == "-" or file in written or file.lower().endswith(".tcl"):
            into.not_parsed(place, tcl=file not in written)
        else:
            into.script(place, _nested(file, session, sources, checked, place))
            if ctx.params.get("keep_going"):
                into.keeps_going = into.keeps_going or place
    return parsed


def script_of(ctx: click.Context) -> str | None:
    """Return the script run by a parsed line, None if none."""
    if ctx.command.name == "source":
        return str(ctx.params["values"][0])
    return str(ctx.params.get("file")) if ctx.command.name == "run" else None


def _nested(file: str, session: Conversation, sources: list[str], checked: dict[str, Reach], place: str) -> Reach:
    """Return the effects of *file*, run by the line at *place*. Raises UsageError if missing or recursive."""
    if file in checked:
        return checked[file]
    if file in sources:
        raise UsageError(f"{place}: {file} runs itself: {' runs '.join([*sources, file])}", place=place)
    if len(sources) > MOST_NESTED:
        raise UsageError(f"{place}: more than {MOST_NESTED} scripts that run each other", place=place)
    try:
        data = read_input_head(file, MOST_BYTES + 1)
    except OSError as failed:
        raise UsageError(f"{place}: {file}: {failed.strerror}", place=place) from failed
    reach = Reach()
    all_parsed(script_lines(data, file), session, [*sources, file], checked, reach)
    checked[file] = reach
    return reach


def _parsed(line: ScriptLine, session: Conversation, source: str) -> click.Context:
    place = f"{source}:{line.number}"
    try:
        ctx = _parsed_as_asked(line, session)
        if ctx.command.name == "tcl":
            raise UsageError(
                "tcl is for the prompt and the shell: a Tcl script is a file of its own", hint="run FILE.tcl"
            )
        return ctx
    except click.ClickException as wrong:
        raise placed(usage_error(wrong), place) from wrong
    except DvtcliError as wrong:
        raise placed(wrong, place) from wrong


def _parsed_as_asked(line: ScriptLine, session: Conversation) -> click.Context:
    """Parse the line; with --json on the line, its error is a document."""
    try:
        return parse(line.words, session)
    except (click.ClickException, DvtcliError):
        if "--json" in line.words:
            session.output.format = "json"  # until the error is shown: then the session settles
        raise
