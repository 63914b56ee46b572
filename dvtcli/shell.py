"""One line's way: found in the one registry, parsed by click, invoked, answered, and judged by an exit code.

Knows commands only by their files' names. Does not know where lines come from (`cli`, `repl`, `commands.run`).
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from importlib import import_module
from typing import TYPE_CHECKING, Any

import click

from dvtcli.options import NEGATIVE_MARK, PREFIX, global_options, one_pair_each, source_of, taken

if TYPE_CHECKING:
    from dvtcli.results import Result
    from dvtcli.session import Session

#: What `exit` answers, so that whoever reads lines stops; never an exit code of the process.
LEAVE = -1
_COMMANDS = os.path.join(os.path.dirname(__file__), "commands")  # noqa: PTH118, PTH120 - pathlib costs 7 ms
_NEGATIVE = re.compile(r"-(?:\d|0x|\.\d).*", re.IGNORECASE)


class DvtCommand(click.Command):
    """A command that also takes the global options, and negative numbers as values."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.params.extend(global_options(hidden=True))

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse *args*, with `-1500` and `-0x10` as values."""
        one_pair_each(args)
        marked = [NEGATIVE_MARK + arg if _NEGATIVE.fullmatch(arg) else arg for arg in args]
        try:
            return super().parse_args(ctx, marked)
        except click.BadParameter as wrong:  # click's own types quote what was typed, with the mark
            said = wrong.message.replace(repr(NEGATIVE_MARK)[1:-1], "").replace(NEGATIVE_MARK, "")
            if said == wrong.message:
                raise
            raise click.BadParameter(said, wrong.ctx, wrong.param, wrong.param_hint) from wrong

    def format_epilog(self, _ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Name the global options that a line may have, once."""
        formatter.write_paragraph()
        formatter.write_text("Also: --dry-run --json --force --yes --timeout S -q -v (help options)")

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command with its line's own global options in force."""
        session: Session = ctx.obj
        with session.line(taken(ctx.params)):
            for text in _notation_notes(ctx.params.values()):
                session.output.note(text)
            return _deliver(session, super().invoke(ctx))


class Registry(click.Group):
    """The one set of commands: every file in `commands/` whose name has no leading underscore."""

    command_class = DvtCommand

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.params.extend(global_options(hidden=False))

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse *args* up to the command."""
        one_pair_each(args)
        return super().parse_args(ctx, args)

    def list_commands(self, _ctx: click.Context) -> list[str]:
        """The commands' names; imports none of them."""
        return command_names()

    def get_command(self, _ctx: click.Context, cmd_name: str) -> click.Command | None:
        """The command *cmd_name*, imported now, or None."""
        if cmd_name not in command_names():
            return _dvt_word(cmd_name)
        command = import_module(f"dvtcli.commands.{cmd_name}").command
        assert isinstance(command, click.Command)  # noqa: S101 - the house's convention, also tested
        return command

    def resolve_command(self, ctx: click.Context, args: list[str]) -> Any:
        """Find the command; an unknown one gets the nearest name."""
        if self.get_command(ctx, args[0]) is None:
            raise click.UsageError(unknown_command(args[0]), ctx)
        return super().resolve_command(ctx, args)

    def format_commands(self, _ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the commands by task, with the first sentence of their files, importing none."""
        from dvtcli.guide import task_sections

        for task, rows in task_sections():
            with formatter.section(task):
                formatter.write_dl(rows)

    def invoke(self, ctx: click.Context) -> Any:
        """Take the global options given before the command, then run it."""
        session: Session = ctx.obj
        given = taken(ctx.params)
        if session.started and given:
            raise click.UsageError("options stand behind the command", ctx)
        if not session.started:
            session.start(given)
            session.sources.update((name, source_of(ctx, name)) for name in given)
        return super().invoke(ctx)


def _dvt_word(name: str) -> click.Command | None:
    """One of the DVT's own words, which are made from one table; None where *name* is none."""
    from dvtcli.dvt.command import word_command

    return word_command(name)


def _notation_notes(values: Iterable[Any]) -> Iterator[str]:
    """What to say of the way some words were written."""
    for value in values:
        if isinstance(value, tuple):
            yield from _notation_notes(value)
        elif note := getattr(value, "notation_note", None):
            yield note


def command_names() -> list[str]:
    """Names of all commands, sorted."""
    names = (name for name in os.listdir(_COMMANDS) if name.endswith(".py"))  # noqa: PTH208
    return sorted(name.removesuffix(".py") for name in names if not name.startswith("_"))


def summary(name: str) -> str:
    """A command's one-line help: the first line of its file, read without importing it."""
    with open(os.path.join(_COMMANDS, f"{name}.py"), encoding="utf-8") as file:  # noqa: PTH118, PTH123
        return file.readline().strip().strip('"').strip()


_TCL_WORDS = frozenset(("proc", "puts", "foreach", "for", "while", "if", "expr", "incr", "catch", "after"))


def unknown_command(name: str, others: Sequence[str] = ()) -> str:
    """What to say of a word that is no command, nor one of *others*."""
    from difflib import get_close_matches

    if name.lower() in ("quit", "q", "bye", "logout"):
        return f"no command is called {name!r}; did you mean 'exit'?"
    from dvtcli.dvt.words import WORDS

    if name in _TCL_WORDS:
        return f"no command is called {name!r}: it is Tcl's, and a Tcl script is a file whose name ends in .tcl"
    close = get_close_matches(name.lower(), [*command_names(), *others, *WORDS], n=1)
    return f"no command is called {name!r}" + (f"; did you mean {close[0]!r}?" if close else "; help lists them")


def _root() -> Registry:
    @click.group(
        cls=Registry,
        name="dvtcli",
        invoke_without_command=True,
        context_settings={"help_option_names": ["-h", "--help"], "terminal_width": _help_width()},
        epilog="Try it without hardware: dvtcli --sim gen4 pdo",
    )
    @click.version_option(package_name=None, version=_version(), prog_name="dvtcli", message="%(prog)s %(version)s")
    @click.pass_context
    def root(ctx: click.Context) -> Any:
        """Configure the PDOs of CANopen devices; never leave one half configured.

        Without a command: the prompt at a terminal, a script from a pipe.
        """
        if ctx.invoked_subcommand is not None:
            return None
        from dvtcli.front import without_command

        return without_command(ctx.obj)

    assert isinstance(root, Registry)  # noqa: S101 - for the type checker
    return root


def _help_width() -> int:
    """The width click gives its help texts, found without importing shutil as click would."""
    try:
        columns = int(os.environ.get("COLUMNS", "0")) or os.get_terminal_size(1).columns
    except (ValueError, OSError):
        columns = 80
    return max(min(columns, 80) - 2, 50)


def _version() -> str:
    from dvtcli import __version__

    return __version__


REGISTRY = _root()


def split(line: str) -> list[str]:
    """A line's words: quotes group, `#` at the start of a word begins a comment, an inner apostrophe is a letter.

    UsageError for an unclosed quote, and for more words than any command takes.
    """
    from dvtcli.errors import UsageError

    if "\0" in line:
        raise UsageError("a NUL character belongs into no command")
    try:
        words = _split(line)
    except ValueError as wrong:
        shown = line.strip() if len(line) <= _SHOWN else line.strip()[:_SHOWN] + "…"
        raise UsageError(f"a quote is not closed: {shown}", hint='write "…" around a name with blanks') from wrong
    if len(words) > _MOST_WORDS:
        raise UsageError(f"{len(words)} words are no command")
    return words


_BLANKS = " \t\r\n"
_SHOWN = 200
#: click takes words off the front of a list, in time that grows with the square of their number
_MOST_WORDS = 10_000


def _split(line: str) -> list[str]:
    """The words of *line* in one pass (shlex takes 19 s for a word of 1 MB); ValueError for an unclosed quote."""
    words: list[str] = []
    word: list[str] = []
    inside, quote, before = False, "", " "
    for char in line:
        starts, before = before.isspace(), char
        if quote:
            if char == quote:
                quote = ""
            else:
                word.append(char)
        elif char in _BLANKS:
            if inside:
                words.append("".join(word))
            word, inside = [], False
        elif char == "#" and starts:
            break
        else:
            inside = True
            if char == '"' or (char == "'" and starts):
                quote = char
            else:
                word.append(char)
    if quote:
        raise ValueError("a quote is not closed")
    return [*words, "".join(word)] if inside else words


def parse(words: Sequence[str], session: Session) -> click.Context:
    """Find and parse one line's command without running it; usage errors are raised here."""
    root = click.Context(REGISTRY, info_name="", obj=session)
    name, *args = words
    if name.startswith("-"):
        raise click.UsageError(f"{name} stands before any command; options stand behind it")
    command = REGISTRY.get_command(root, name)
    if command is None:
        raise click.UsageError(unknown_command(name))
    return command.make_context(name, list(args), parent=root)


def run_parsed(ctx: click.Context, session: Session) -> int:
    """Run a parsed line and answer its exit code; results and errors are shown on the way."""

    def invoke() -> Any:
        with ctx:
            return ctx.command.invoke(ctx)

    return boundary(session, invoke)


def run_words(words: Sequence[str], session: Session) -> int:
    """Parse and run one line."""
    return boundary(session, lambda: _parse_and_invoke(words, session))


def _parse_and_invoke(words: Sequence[str], session: Session) -> Any:
    with parse(words, session) as ctx:
        return ctx.command.invoke(ctx)


def _deliver(session: Session, result: Any) -> Any:
    """Show what a command answered; an int is an exit code, None says nothing."""
    if result is None or isinstance(result, int):
        return result
    session.output.result(result)
    return _code(result)


def _code(result: Result) -> int:
    return result.exit_code


def boundary(session: Session, run: Callable[[], Any]) -> int:
    """Run something and turn whatever comes of it into an exit code: the one place where errors end."""
    from dvtcli.boundary import guarded

    return guarded(session, run)


__all__ = ["LEAVE", "PREFIX", "REGISTRY", "DvtCommand", "boundary", "parse", "run_parsed", "run_words", "split"]
