"""Parse a script before its first line runs, and decide if all its lines can be rolled back."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import Effect, Final, of_line
from dvtcli.cli.global_options import PREFIX
from dvtcli.cli.lexer import split
from dvtcli.cli.parse_line import parse
from dvtcli.errors import DvtcliError, InputFileError, UsageError
from dvtcli.files.input_file import read_input_head

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation

#: Maximum size of a script (bytes).
MOST_BYTES = 10_000_000
#: Maximum number of commands: all are parsed before the first runs.
MOST_COMMANDS = 10_000
#: Maximum number of lines with errors that are reported; further lines are not parsed.
MOST_FAULTS = 20
#: What editors show as the end of a line; `str.splitlines` also splits at characters that nobody sees.
_LINE_END = re.compile("\r\n|\n|\r")


@dataclass(frozen=True, slots=True)
class ScriptLine:
    """A command of a script with its first line number, from 1; *fault* is why it has no words."""

    number: int
    words: list[str]
    fault: DvtcliError | None = None


def script_lines(data: bytes, source: str, first_line: int = 1) -> list[ScriptLine]:
    """Return the commands in *data*, numbered from *first_line*; a backslash at a line's end continues the line.

    Raises UsageError or InputFileError with FILE:LINE.
    """
    lines = read_lines(data, source, first_line)
    for line in lines:
        if line.fault is not None:
            raise line.fault
    return lines


def read_lines(data: bytes, source: str, first_line: int = 1) -> list[ScriptLine]:
    """Return the commands in *data* as `script_lines`; a line that has no words has its *fault*.

    Raises InputFileError with FILE:LINE if *data* is not text or too long.
    """
    text = decoded_script(data, source)
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
        _take(found, _split_line(" ".join([*pending, raw]), began, source), source)
        pending, began = [], 0
    return found


def _take(found: list[ScriptLine], line: ScriptLine, source: str) -> None:
    """Append *line* to *found* unless empty. Raises InputFileError if there are too many."""
    if not line.words and line.fault is None:
        return
    found.append(line)
    if len(found) > MOST_COMMANDS:
        place = f"{source}:{line.number}"
        raise InputFileError(f"{place}: a script has at most {MOST_COMMANDS} commands", place=place)


def _gateway_lines(text: str, source: str) -> list[ScriptLine]:
    """Convert lines of a gateway's client to commands."""
    from dvtcli.cli.scripts.gateway_script import GatewayScript

    script, found = GatewayScript(), list[ScriptLine]()
    for number, text_line in enumerate(_LINE_END.split(text), 1):
        try:
            line = ScriptLine(number, script.words(text_line, f"{source}:{number}"))
        except UsageError as wrong:
            line = ScriptLine(number, [], wrong)
        _take(found, line, source)
    return found


def decoded_script(data: bytes, source: str) -> str:
    """Decode a script. Raises InputFileError with FILE:LINE if it is not text."""
    if len(data) > MOST_BYTES:
        raise InputFileError(f"{source}: {len(data)} bytes are too many for a script", place=source)
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as wrong:
        number = data[: wrong.start].count(b"\n") + 1
        raise InputFileError(f"{source}:{number}: not UTF-8 text", place=f"{source}:{number}") from wrong


def _split_line(text: str, number: int, source: str) -> ScriptLine:
    try:
        return ScriptLine(number, split(text))
    except UsageError as wrong:
        return ScriptLine(number, [], placed(wrong, f"{source}:{number}"))


def placed(wrong: DvtcliError, place: str) -> DvtcliError:
    """Return *wrong* with *place* as its place."""
    from dvtcli.cli.view.typed_hints import error_text

    wrong.text, wrong.given, wrong.place = f"{place}: {error_text(wrong)}", {}, place
    return wrong


#: Maximum nesting of scripts.
MOST_NESTED = 20


def all_parsed(
    lines: list[ScriptLine], session: Conversation, sources: list[str], checked: dict[str, Reach], reach: Reach
) -> list[tuple[ScriptLine, click.Context]]:
    """Parse all lines, including scripts run by them, before any runs.

    *sources* is the chain of running scripts, outermost first; *checked* has the effects of files already checked;
    *reach* collects the effects of these lines. Raises the first line's error, which has those of the other lines.
    """
    parsed: list[tuple[ScriptLine, click.Context]] = []
    written: set[str] = set()
    faults: list[DvtcliError] = []
    for line in lines:
        try:
            parsed.append((line, _checked(line, session, sources, checked, reach, written)))
        except DvtcliError as wrong:
            faults += (wrong, *wrong.others)
            wrong.others = ()
            written.update(line.words)  # it may be a `save` of a file that a later line runs
            if len(faults) >= MOST_FAULTS:
                break
    if faults:
        faults[0].others = tuple(faults[1:])
        raise faults[0]
    return parsed


def _checked(
    line: ScriptLine, session: Conversation, sources: list[str], checked: dict[str, Reach], reach: Reach,
    written: set[str],
) -> click.Context:  # fmt: skip
    """Parse *line* and the script that it runs, add their effects to *reach*, and files that it saves to *written*."""
    if line.fault is not None:
        raise line.fault
    ctx, place = _parsed(line, session, sources[-1]), f"{sources[-1]}:{line.number}"
    reach.line(place, ctx)
    file, into = script_of(ctx), Reach() if is_rehearsal(ctx) else reach
    if ctx.command.name == "save":
        written.add(str(ctx.params.get("file")))
    elif file is None:
        pass
    elif file == "-" or file in written or file.lower().endswith(".tcl"):
        into.not_parsed(place, tcl=file not in written)
    else:
        into.script(place, _nested(file, session, sources, checked, place))
        if ctx.params.get("keep_going"):
            into.keeps_going = into.keeps_going or place
    return ctx


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
    all_parsed(read_lines(data, file), session, [*sources, file], checked, reach)
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
    except (click.ClickException, UsageError) as wrong:
        from dvtcli.cli.corrected_line import with_correction

        raise placed(with_correction(wrong, line.words, session, in_file=True), place) from wrong
    except DvtcliError as wrong:
        raise placed(wrong, place) from wrong


def _parsed_as_asked(line: ScriptLine, session: Conversation) -> click.Context:
    """Parse the line; with --json on the line, its error is a document."""
    try:
        return parse(line.words, session, in_file=True)
    except (click.ClickException, DvtcliError):
        if "--json" in line.words:
            session.output.format = "json"  # until the error is shown: then the options are reset
        raise


def is_rehearsal(ctx: click.Context) -> bool:
    """Whether the parsed line, not yet run, works on twins by its own option."""
    return bool(ctx.params.get(f"{PREFIX}dry_run"))


def final(ctx: click.Context) -> Final | None:
    """Return the part of the parsed line that no undo reverts; None if none."""
    return None if is_rehearsal(ctx) else of_line(ctx).final(ctx.params)


def stores(ctx: click.Context) -> Final | None:
    """Return the store that may follow the parsed line's changes; None for lines without changes or stores."""
    return None if is_rehearsal(ctx) else of_line(ctx).stores(ctx.params)


def is_changing(ctx: click.Context) -> bool:
    """Whether the parsed line changes a node in a way that undo can revert."""
    return not is_rehearsal(ctx) and of_line(ctx).effect is Effect.CHANGES and final(ctx) is None


def does_other(ctx: click.Context) -> bool:
    """Whether the parsed line affects a node in a way not recorded in its history."""
    return not is_rehearsal(ctx) and (final(ctx) is not None or of_line(ctx).effect is Effect.COMMANDS)


@dataclass(slots=True)
class Reach:
    """The effects of a script from its first line: whether it *changes* nodes, and its first *final* line."""

    changes: bool = False
    final: tuple[str, str] | None = None
    #: the first final line followed by a changing line, with the latter's place
    wrong: tuple[str, str, str] | None = None
    #: the first line with a script that cannot be parsed in advance, and with --keep-going
    opaque: str | None = None
    keeps_going: str | None = None

    def line(self, place: str, ctx: click.Context) -> None:
        """Add the line at *place* (`FILE:LINE`)."""
        if is_changing(ctx):
            self._change(place)
        found = final(ctx) or stores(ctx)
        if found is not None and self.final is None:
            self.final = (place, found.words)

    def script(self, place: str, other: Reach) -> None:
        """Add the script run by the line at *place*."""
        if other.changes:
            self._change(place)
        self.wrong, self.opaque = self.wrong or other.wrong, self.opaque or other.opaque
        self.keeps_going = self.keeps_going or other.keeps_going
        self.final = self.final or other.final

    def not_parsed(self, place: str, *, tcl: bool) -> None:
        """Add a script that does not exist yet, or a Tcl script, with unknown effects."""
        self._change(place)
        if tcl:
            self.opaque = self.opaque or place

    def _change(self, place: str) -> None:
        self.changes = True
        if self.final is not None:
            self.wrong = self.wrong or (*self.final, place)

    def refuse(self) -> None:
        """Raise UsageError with FILE:LINE if an atomic script could not roll back all lines."""
        if self.opaque is not None:
            raise UsageError(
                f"{self.opaque}: an atomic script cannot run a Tcl script, since its changes are unknown before it "
                f"runs",
                place=self.opaque,
            )
        if self.keeps_going is not None:
            raise UsageError(
                f"{self.keeps_going}: --keep-going and --atomic exclude each other: a failing line ends it",
                place=self.keeps_going,
            )
        if self.wrong is not None:
            place, word, later = self.wrong
            raise UsageError(
                f"{place}: `{word}` cannot be rolled back, but {later} changes something after it",
                place=place,
                hint="in an atomic script, put it after the last line that changes something",
            )
