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

from dvtcli.boundary import usage_error
from dvtcli.errors import DvtcliError, InputFileError, UsageError
from dvtcli.shell import LEAVE, boundary, parse, run_parsed, split

if TYPE_CHECKING:
    from dvtcli.session import Session

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


def run_script(session: Session, data: bytes, source: str, *, keep_going: bool) -> int:
    """Run a script's *data*; *source* names it in messages.

    The first failing line stops it and gives the exit code; with *keep_going* it runs on and ends with the
    first failure's code, or 7 where there was one.
    """
    refuse_own_run(session, source)
    lines = script_lines(data, source)
    session.started = True
    parsed = _all_parsed(lines, session, [*session.scripts, source], set())

    def run() -> int:
        codes = _run_lines(session, parsed, source, keep_going=keep_going)
        return 0 if not codes else 7 if 7 in codes else codes[0]

    return enclosed(session, source, run)


def refuse_own_run(session: Session, source: str) -> None:
    """Raise UsageError where the script *source* is under way already."""
    if source in session.scripts:
        raise UsageError(f"{source} runs itself: {' runs '.join([*session.scripts, source])}", place=source)


def enclosed(session: Session, source: str, run: Callable[[], int]) -> int:
    """Run a script's content inside one NMT gate; its exit code."""
    outer = session.place
    session.scripts.append(source)
    try:
        code = boundary(session, run)
    finally:
        session.scripts.pop()
        session.place = outer
    if session.in_script:
        return code
    # after a failure (a difference is none) the set-up is neither old nor new: its nodes stay PRE-OPERATIONAL
    return boundary(session, lambda: session.end_line(7 if code not in (0, 3) else 0)) or code


def _run_lines(
    session: Session, parsed: list[tuple[ScriptLine, click.Context]], source: str, *, keep_going: bool
) -> list[int]:
    """Run the lines and answer the exit codes of those that failed."""
    codes: list[int] = []
    for line, ctx in parsed:
        if session.cancellation.requested:  # asked for while the last line's last write was under way
            return [*codes, session.cancellation.exit_code]
        session.place = f"{source}:{line.number}"
        code = run_parsed(ctx, session)
        if code == LEAVE:
            break
        if code:
            codes.append(code)
            if not keep_going or code in (130, 143):
                break
    return codes


def script_lines(data: bytes, source: str) -> list[ScriptLine]:
    """The commands in *data*; a backslash at a line's end continues it. UsageError or InputFileError with FILE:LINE."""
    text = script_text(data, source)
    found: list[ScriptLine] = []
    pending: list[str] = []
    began = 0
    raws = _LINE_END.split(text)
    for number, raw in enumerate(raws, 1):
        if not raw and not pending:
            continue
        began = began or number
        if raw.endswith("\\") and number < len(raws):
            pending.append(raw[:-1])
            continue
        words = _words(" ".join([*pending, raw]), f"{source}:{began}")
        if words:
            found.append(ScriptLine(began, words))
            if len(found) > MOST_COMMANDS:
                place = f"{source}:{began}"
                raise InputFileError(f"{place}: more than {MOST_COMMANDS} commands are no script", place=place)
        pending, began = [], 0
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
    lines: list[ScriptLine], session: Session, sources: list[str], checked: set[str]
) -> list[tuple[ScriptLine, click.Context]]:
    """Every line parsed, and those of the scripts that it runs, before any of them runs.

    *sources* run each other, the outermost first; *checked* are files that were found right.
    """
    parsed: list[tuple[ScriptLine, click.Context]] = []
    written: set[str] = set()
    for line in lines:
        ctx = _parsed(line, session, sources[-1])
        parsed.append((line, ctx))
        file = str(ctx.params.get("file"))
        if ctx.command.name == "save":
            written.add(file)
        elif ctx.command.name == "run" and file != "-" and file not in written and not file.lower().endswith(".tcl"):
            _check_nested(file, session, sources, checked, f"{sources[-1]}:{line.number}")
    return parsed


def _check_nested(file: str, session: Session, sources: list[str], checked: set[str], place: str) -> None:
    """Parse the script *file*, which the line at *place* runs; UsageError where it is missing or runs itself."""
    if file in checked:
        return
    if file in sources:
        raise UsageError(f"{place}: {file} runs itself: {' runs '.join([*sources, file])}", place=place)
    if len(sources) > MOST_NESTED:
        raise UsageError(f"{place}: more than {MOST_NESTED} scripts that run each other", place=place)
    try:
        with Path(file).open("rb") as script:
            data = script.read(MOST_BYTES + 1)
    except OSError as failed:
        raise UsageError(f"{place}: {file}: {failed.strerror}", place=place) from failed
    _all_parsed(script_lines(data, file), session, [*sources, file], checked)
    checked.add(file)


def _parsed(line: ScriptLine, session: Session, source: str) -> click.Context:
    place = f"{source}:{line.number}"
    try:
        return _parsed_as_asked(line, session)
    except click.ClickException as wrong:
        raise _placed(usage_error(wrong), place) from wrong
    except DvtcliError as wrong:
        raise _placed(wrong, place) from wrong


def _parsed_as_asked(line: ScriptLine, session: Session) -> click.Context:
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
