"""Scripts: parsed whole before the first line runs, then run line by line inside one NMT gate.

Does not know where the text came from, and never asks anything.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import click

from dvtcli.cli.boundary import LEAVE, SIGNALLED, usage_error
from dvtcli.cli.lexer import split
from dvtcli.cli.run_line import boundary, parse
from dvtcli.cli.scripts.atomic import Reach, is_rehearsal
from dvtcli.cli.scripts.script_changes import ScriptChanges
from dvtcli.cli.scripts.script_run import look_again, run_line
from dvtcli.errors import Bug, DvtcliError, InputFileError, LeftChanged, UsageError

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation

#: A script is text typed by people; beyond this many bytes it is something else.
MOST_BYTES = 10_000_000
#: Each command takes time and memory to parse, and all are parsed before the first one runs.
MOST_COMMANDS = 10_000
#: Scripts that run scripts that run scripts; deeper is a mistake.
MOST_NESTED = 20
#: What editors show as the end of a line; `str.splitlines` also splits at characters that nobody sees.
_LINE_END = re.compile("\r\n|\n|\r")


@dataclass(frozen=True, slots=True)
class ScriptLine:
    """One command of a script with the line number where it begins, 1 and up."""

    number: int
    words: list[str]


def run_script(
    session: Conversation, data: bytes, source: str, *, keep_going: bool, atomic: bool = False, first_line: int = 1
) -> int:
    """Run a script's *data*; *source* names it in messages, *first_line* is where the data begins in it.

    The first failing line stops it and gives the exit code; with *keep_going* it runs on and ends with the
    first failure's code, or 7 where there was one, or that of the signal that ended it. With *atomic* a failing line
    takes back all lines before it; UsageError where a line could not be.
    """
    refuse_own_run(session, source)
    if atomic and keep_going:
        raise UsageError("--atomic and --keep-going exclude each other: a failing line takes all lines back")
    lines = script_lines(data, source, first_line)
    session.started = True
    reach = Reach()
    parsed = _all_parsed(lines, session, [*session.scripts, source], {}, reach)
    if atomic:
        reach.refuse()

    def run() -> int:
        return worst(_run_lines(session, parsed, source, keep_going=keep_going))

    return enclosed(session, source, run, atomic=atomic)


def worst(codes: list[int]) -> int:
    """The exit code of a script whose failing lines ended with *codes*."""
    if 7 in codes:
        return 7
    return next((code for code in codes if code in SIGNALLED), codes[0] if codes else 0)


def refuse_own_run(session: Conversation, source: str) -> None:
    """Raise UsageError where the script *source* is under way already."""
    if source in session.scripts:
        raise UsageError(f"{source} runs itself: {' runs '.join([*session.scripts, source])}", place=source)


def enclosed(session: Conversation, source: str, run: Callable[[], int], *, atomic: bool = False) -> int:
    """Run a script's content inside one NMT gate; its exit code. *atomic* keeps all of its changes, or none."""
    outer, outer_changes = session.place, session.script_changes
    session.scripts.append(source)
    changes = outer_changes
    if changes is None or (atomic and not changes.atomic):
        session.script_changes = changes = ScriptChanges(session, source, atomic=atomic, outer=outer_changes)
    try:
        code = boundary(session, run)
        if not code and changes is not outer_changes:
            code = boundary(session, lambda: look_again(session, changes))
        stays = bool(session.staying())
    finally:
        session.scripts.pop()
        session.place, session.script_changes = outer, outer_changes
    if changes is not outer_changes:  # before others may write to the nodes, which they may once these are settled
        code = boundary(session, lambda: changes.end(complete=not code)) or code
    if session.in_script:
        return code
    settled = _settled(session, code, stays=stays)
    return code or settled


def _settled(session: Conversation, code: int, *, stays: bool) -> int:
    """Bring the nodes to the NMT state they were found in, at the end of the outermost script; the exit code."""
    # after a failure (a difference is none) of which some stays, the set-up is neither old nor new: its nodes stay
    # PRE-OPERATIONAL
    half = code in (LeftChanged.exit_code, Bug.exit_code) or (stays and code not in (0, 3))
    return boundary(session, lambda: session.end_line(7 if half else 0, alone=not code))


def _run_lines(
    session: Conversation, parsed: list[tuple[ScriptLine, click.Context]], source: str, *, keep_going: bool
) -> list[int]:
    """Run the lines and answer the exit codes of those that failed."""
    codes: list[int] = []
    lines = iter(parsed)
    for line, ctx in lines:
        session.place = f"{source}:{line.number}"
        code = _reported(session, source, line, ctx)
        if code == LEAVE:
            session.left = len(session.scripts) == 1  # a nested script ends alone
            break
        if code:
            codes.append(code)
            if not keep_going or code in SIGNALLED:
                break
    if session.report is not None:
        for line, _ in lines:
            session.report.left_out(source, line.number, _shown(session, line))
    return codes


def _reported(session: Conversation, source: str, line: ScriptLine, ctx: click.Context) -> int:
    """Run a parsed line and answer its exit code, which a report learns."""
    report = session.report
    if report is None:
        return run_line(session, ctx)
    ran = report.begin(source, line.number, _shown(session, line))
    code = run_line(session, ctx)
    report.end(ran, 0 if code == LEAVE else code)
    return code


def _shown(session: Conversation, line: ScriptLine) -> str:
    """The line as a report names it; of one that may hold a passcode the command only."""
    text = " ".join(line.words)
    return line.words[0] if session.is_secret(text) else text


def script_lines(data: bytes, source: str, first_line: int = 1) -> list[ScriptLine]:
    """The commands in *data*, which begins at *first_line*; a backslash at a line's end continues it.

    UsageError or InputFileError with FILE:LINE.
    """
    text = script_text(data, source)
    if source.lower().endswith(".309"):
        return _gateway_lines(text, source)
    found: list[ScriptLine] = []
    pending: list[str] = []
    began = 0
    raws = _LINE_END.split(text)
    for number, raw in enumerate(raws, first_line):
        if not raw and not pending:
            continue
        began = began or number
        if raw.endswith("\\") and number < first_line + len(raws) - 1:
            pending.append(raw[:-1])
            continue
        words = _words(" ".join([*pending, raw]), f"{source}:{began}")
        _take(found, ScriptLine(began, words), source)
        pending, began = [], 0
    return found


def _take(found: list[ScriptLine], line: ScriptLine, source: str) -> None:
    """Put *line* behind those that were *found*, unless it is empty; InputFileError where they are too many."""
    if not line.words:
        return
    found.append(line)
    if len(found) > MOST_COMMANDS:
        place = f"{source}:{line.number}"
        raise InputFileError(f"{place}: more than {MOST_COMMANDS} commands are no script", place=place)


def _gateway_lines(text: str, source: str) -> list[ScriptLine]:
    """The commands that the lines of a gateway's client mean."""
    from dvtcli.cli.scripts.gateway_script import GatewayScript

    script, found = GatewayScript(), list[ScriptLine]()
    for number, line in enumerate(_LINE_END.split(text), 1):
        _take(found, ScriptLine(number, script.words(line, f"{source}:{number}")), source)
    return found


def script_text(data: bytes, source: str) -> str:
    """The text of a script; InputFileError with FILE:LINE where it is none."""
    if len(data) > MOST_BYTES:
        raise InputFileError(f"{source}: {len(data)} bytes are no script", place=source)
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as wrong:
        number = data[: wrong.start].count(b"\n") + 1
        raise InputFileError(f"{source}:{number}: not UTF-8 text", place=f"{source}:{number}") from wrong


def _words(line: str, place: str) -> list[str]:
    try:
        return split(line)
    except UsageError as wrong:
        raise _placed(wrong, place) from wrong


def _all_parsed(
    lines: list[ScriptLine], session: Conversation, sources: list[str], checked: dict[str, Reach], reach: Reach
) -> list[tuple[ScriptLine, click.Context]]:
    """Every line parsed, and those of the scripts that it runs, before any of them runs.

    *sources* run each other, the outermost first; *checked* are files that were found right, with what they do;
    *reach* learns what these lines do.
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
    """The script that a parsed line runs, None where it runs none."""
    if ctx.command.name == "source":
        return str(ctx.params["values"][0])
    return str(ctx.params.get("file")) if ctx.command.name == "run" else None


def _nested(file: str, session: Conversation, sources: list[str], checked: dict[str, Reach], place: str) -> Reach:
    """What the script *file* does, which the line at *place* runs; UsageError where it is missing or runs itself."""
    if file in checked:
        return checked[file]
    if file in sources:
        raise UsageError(f"{place}: {file} runs itself: {' runs '.join([*sources, file])}", place=place)
    if len(sources) > MOST_NESTED:
        raise UsageError(f"{place}: more than {MOST_NESTED} scripts that run each other", place=place)
    try:
        with Path(file).open("rb") as script:
            data = script.read(MOST_BYTES + 1)
    except OSError as failed:
        raise UsageError(f"{place}: {file}: {failed.strerror}", place=place) from failed
    reach = Reach()
    _all_parsed(script_lines(data, file), session, [*sources, file], checked, reach)
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
        raise _placed(usage_error(wrong), place) from wrong
    except DvtcliError as wrong:
        raise _placed(wrong, place) from wrong


def _parsed_as_asked(line: ScriptLine, session: Conversation) -> click.Context:
    """The line parsed; an error of a line with --json is a document as its result would have been."""
    try:
        return parse(line.words, session)
    except (click.ClickException, DvtcliError):
        if "--json" in line.words:
            session.output.format = "json"  # until the error is shown: then the session settles
        raise


def _placed(wrong: DvtcliError, place: str) -> DvtcliError:
    wrong.text, wrong.place = f"{place}: {wrong.text}", place
    return wrong
