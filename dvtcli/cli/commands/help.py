"""Show all commands by task, one command with its examples, or a topic."""

from __future__ import annotations

import inspect
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

import click
from click.shell_completion import CompletionItem

from dvtcli.cli.catalogue import TASKS, command_names, summary, task_rows, task_sections, unknown_command
from dvtcli.cli.command import DvtCommand, Effect
from dvtcli.cli.params import TextType
from dvtcli.cli.runner_interface import root
from dvtcli.errors import UsageError
from dvtcli.operations.user.refused_options import refuse_options

if TYPE_CHECKING:
    from dvtcli.operations.results import Facts


class HelpTopic(TextType):
    """The name of a command or a topic."""

    name = "subject"

    def shell_complete(self, _ctx: click.Context, _param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """Offer commands and topics with their one-line texts."""

        rows = [(name, summary(name)) for name in command_names()]
        rows += [(name, topic(name).splitlines()[0]) for name in TOPICS]
        return [CompletionItem(name, help=text) for name, text in rows if name.startswith(incomplete.lower())]


@click.command("help", cls=DvtCommand, short_help=__doc__, effect=Effect.NONE, needs_settings=False)
@click.argument("name", type=HelpTopic(), required=False, metavar="[COMMAND|TOPIC]")
@click.option("--all", "everything", is_flag=True, help="Show what each command does, and all global options.")
@click.option("--man", "manual_page", is_flag=True, help="The manual page in roff: help --man > dvtcli.1")
@click.pass_context
def command(ctx: click.Context, /, name: str | None, everything: bool, manual_page: bool) -> Facts:
    """Show all commands by task, or COMMAND with its options and examples, or a TOPIC.

    Also explains an SDO abort code, and a rule by its name.

    \b
    help
    help map
    help objects
    help 0x06040041
    help pdo-length
    help --all
    help --man
    """
    from dvtcli.operations.results import Facts

    if name is not None:
        refuse_options({"all": everything, "man": manual_page}, f"not with a name such as {name}")
    if everything and manual_page:
        raise UsageError("they exclude each other", given={"all": True, "man": True})
    if manual_page:
        from dvtcli.version import __version__

        page = manual(root(ctx), __version__)
        return Facts("help", (("text", "\n".join(page)),), tuple(page))
    text = _subject(ctx, name.lower()) if name is not None else _general(ctx, everything=everything)
    return Facts("help", (("text", text),), tuple(text.splitlines()))


def _general(ctx: click.Context, *, everything: bool) -> str:

    if everything:
        return root(ctx).long_help(click.Context(root(ctx), info_name="dvtcli"))
    return "\n".join(overview(_usable(ctx)))


def _usable(ctx: click.Context) -> dict[str, str]:
    from dvtcli.cli.prompt.line import usable_aliases

    return usable_aliases(ctx.obj.settings)


def _subject(ctx: click.Context, name: str) -> str:
    """Return the help of a command, else of a topic, an alias, an SDO abort code or a rule."""

    found = root(ctx).get_command(ctx, name)
    if found is not None:
        return found.get_help(click.Context(found, info_name=name))
    if name in TOPICS:
        return topic(name)
    aliases = {word.lower(): text for word, text in _usable(ctx).items()}
    if name in aliases:
        return f"{name}  at the prompt, an alias of: {aliases[name]}"
    from dvtcli.cli.look_up import abort_help, rule_help

    text = abort_help(name) or rule_help(name)
    if text is None:
        raise click.UsageError(unknown_command(name, TOPICS), ctx)
    return text


def manual(program: click.Group, version: str) -> list[str]:
    """Return the lines of dvtcli(1), for *program* with all its commands."""
    root = click.Context(program, info_name="dvtcli")
    lines = [f'.TH DVTCLI 1 "" "dvtcli {version}" "User Commands"', ".SH NAME"]
    lines += [
        r"dvtcli \- configure the PDOs of CANopen devices",
        ".SH SYNOPSIS",
        r"\fBdvtcli\fR [OPTIONS] [COMMAND ...]",
    ]
    lines += [".SH DESCRIPTION", *_plain(inspect.cleandoc(program.help or ""))]
    lines += [".SH OPTIONS", *_options(program, root)]
    for task, rows in task_sections():
        lines.append(f'.SH "{_escaped(task.upper())}"')
        for name, _ in rows:
            lines += _command(program, root, name)
    for name in TOPICS:
        title, *rest = topic(name).splitlines()
        lines += [f'.SH "{_escaped(title.upper())}"', ".nf", *_plain("\n".join(rest), paragraphs=False), ".fi"]
    return lines


def _command(program: click.Group, root: click.Context, name: str) -> Iterator[str]:
    found = program.get_command(root, name)
    assert found is not None  # noqa: S101 - the name is the registry's own
    ctx = click.Context(found, info_name=name)
    pieces = " ".join(found.collect_usage_pieces(ctx)).replace("[OPTIONS] ", "").replace("[OPTIONS]", "")
    yield f".SS {_escaped(f'{name} {pieces}'.strip())}"
    prose, _, examples = inspect.cleandoc(found.help or "").partition("\b\n")
    yield from _plain(prose.strip())
    if examples:
        yield from (".PP", ".nf", *_plain(examples.replace("\b\n", ""), paragraphs=False), ".fi")
    yield from _options(found, ctx)


def _options(found: click.Command, ctx: click.Context) -> Iterator[str]:
    for option in found.get_params(ctx):
        record = option.get_help_record(ctx)
        if record is not None:
            yield from (".TP", rf"\fB{_escaped(record[0])}\fR", _escaped(record[1]))


def _plain(text: str, *, paragraphs: bool = True) -> Iterator[str]:
    for line in text.splitlines():
        yield _escaped(line) if line.strip() or not paragraphs else ".PP"


def _escaped(text: str) -> str:
    """Escape *text* for roff, so that no line is a request."""
    text = text.replace("\\", r"\e").replace("-", r"\-").replace("'", r"\(aq").replace("\u2026", "...")
    return rf"\&{text}" if text.startswith(".") else text


#: Names of the text files in `topics/`, sorted.
TOPICS = ("dvt", "network", "options", "writing")


def topic(name: str) -> str:
    """Return the text of topic *name*; the first line is its subject."""
    from importlib.resources import files

    return (files("dvtcli.cli") / "help" / "topics" / f"{name}.txt").read_text("utf-8").rstrip()


def overview(aliases: Mapping[str, str] | None = None) -> list[str]:
    """Return the first screen of help: commands by task, topics, *aliases*, and first steps."""
    width = max(map(len, TASKS))
    lines = ["Commands, by task:", *task_rows(), "", "Topics:"]
    lines += [f"  {name:<{width}}  {topic(name).splitlines()[0]}" for name in TOPICS]
    lines += ["", "Aliases, at the prompt:"] if aliases else []
    lines += [f"  {word:<{width}}  {text}" for word, text in sorted((aliases or {}).items())]
    lines += [
        "",
        "help NAME     a command with examples, or a topic",
        "help --all    what each command does, and the global options",
    ]
    return lines
