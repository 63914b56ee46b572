"""Show all commands by task, one command with its examples, or a topic."""

from __future__ import annotations

import inspect
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

import click
from click.formatting import wrap_text
from click.shell_completion import CompletionItem

from dvtcli.cli.catalogue import TASKS, command_names, summary, task_rows, task_sections, unknown_command
from dvtcli.cli.command import DvtCommand, Effect
from dvtcli.cli.params import TextType
from dvtcli.cli.runner_interface import root
from dvtcli.domain.abort import abort_text, code_of
from dvtcli.domain.lint import LintRule
from dvtcli.domain.rules.finding import Rule

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


@click.command("help", cls=DvtCommand, short_help=__doc__, effect=Effect.READS, needs_settings=False)
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


#: The usual cause of each abort code of CiA 301, and what to do.
USUAL_CAUSES = {
    0x0503_0000: "a second SDO client, or lost frames: end the other master, try again",
    0x0504_0000: "the device waited too long for the next frame: a full bus; try again",
    0x0504_0001: "the device does not know this kind of transfer, or a second client uses the SDO channel",
    0x0504_0002: "a fault of the device's block transfer",
    0x0504_0003: "lost frames in a block transfer: try again",
    0x0504_0004: "lost or altered data in a block transfer: try again",
    0x0504_0005: "the device is short of memory: use fewer transfers at once, or reset it",
    0x0601_0000: "the object is locked now: it needs another NMT state or a login, or this firmware lacks it",
    0x0601_0001: "none: the object has no readable value",
    0x0601_0002: "a fixed mapping or COB-ID, or the device needs a login first",
    0x0602_0000: "wrong index (indices are hexadecimal here), or the EDS is of another revision",
    0x0604_0041: "`objects --mappable tpdo` (or `rpdo`); check the direction and the length",
    0x0604_0042: "more than 64 bits in the PDO, or more entries than the device allows",
    0x0604_0043: "another parameter excludes this value: see the device's manual",
    0x0604_0047: "the device's configuration contradicts itself: see its manual, or `restore`",
    0x0606_0000: "often the EEPROM: try again, then suspect the device",
    0x0607_0010: "the object's length differs from the EDS: `read` it, or use `--as u16`",
    0x0607_0012: "the same: use a shorter type",
    0x0607_0013: "the same: use a longer type",
    0x0609_0011: "sub-indices are hexadecimal here; the array may be shorter in this firmware",
    0x0609_0030: "out of range; at 0x1800:02 or 0x1A00 often a PDO that must be disabled first, which dvtcli does",
    0x0609_0031: "above the object's upper limit: `objects` shows the limit in the EDS",
    0x0609_0032: "below the object's lower limit",
    0x0609_0036: "write the other limit first",
    0x060A_0023: "the SDO channel is in use by another client",
    0x0800_0000: "a wrong state of the device, or a missing login; the error history (`faults`) may have the cause",
    0x0800_0020: "a wrong signature, or the device cannot store now",
    0x0800_0021: "the device is operated locally: switch it to remote",
    0x0800_0022: "the device needs PRE-OPERATIONAL (`nmt preop`), or the power stage off",
    0x0800_0023: "the device is not configured, or in its boot loader",
    0x0800_0024: "the value does not exist yet",
}


def abort_help(name: str) -> str | None:
    """Return the meaning and the usual cause of the abort code *name*, with or without 0x; None if it is none."""
    code = code_of(name)
    if code is None:
        return None
    rules = ", ".join(rule.name for rule in _rules_of_changes() if code in rule.aborts)
    lines = [f"0x{code:08X}: {abort_text(code)}", "", *_row("cause", USUAL_CAUSES[code])]
    lines += _row("rules", f"checked before a write: {rules}; `help RULE` explains a rule") if rules else []
    lines += _row("source", "CiA 301, table 22")
    return "\n".join([*lines, "", "An error shows `why` if the device's profile gives the code another cause."])


def rule_help(name: str) -> str | None:
    """Return the severity, condition and source of the rule *name*, for each kind of check; None if it is none."""
    found = [row for kind, rules in _every_rule() for row in _rule_lines(kind, rules, name)]
    return "\n".join([f"{name}: a rule", *found]) if found else None


def _rules_of_changes() -> tuple[Rule, ...]:
    from dvtcli.device.access_level import RULES as LOGIN_RULES
    from dvtcli.device.change import apply_again
    from dvtcli.operations.changes import undo
    from dvtcli.operations.network.check_networks import rules_of_changes
    from dvtcli.operations.objects import write_object
    from dvtcli.operations.pdos import sync
    from dvtcli.operations.session import consent

    others = (apply_again, undo, write_object, sync, consent)
    return (*rules_of_changes(), *LOGIN_RULES, *(rule for file in others for rule in file.RULES))


def _every_rule() -> Iterator[tuple[str, Sequence[Rule | LintRule]]]:
    """Iterate over the kinds of checks with their rules."""
    from dvtcli.domain.network.check.network_rules import NETWORK_RULES
    from dvtcli.files.device_lint import EVERY_RULE
    from dvtcli.operations.network.check_networks import FILE_RULES
    from dvtcli.watch.recording_checks.recording_rules import RECORDING_RULES, UNREADABLE

    yield "of a change (`map`, `set`, `write`, `link`, `plan`, `apply`)", _rules_of_changes()
    yield "of `check`, for a network", (*FILE_RULES, *NETWORK_RULES)
    yield "of `check`, for a recording", (*RECORDING_RULES, UNREADABLE)
    yield "of `eds check`", EVERY_RULE


def _rule_lines(kind: str, rules: Sequence[Rule | LintRule], name: str) -> Iterator[str]:
    for rule in rules:
        if rule.name != name:
            continue
        severities = rule.severities if isinstance(rule, Rule) else (rule.severity,)
        yield from ("", f"  {' or '.join(map(str, severities))} {kind}")
        yield from _row("finding", rule.sense)
        yield from _row("source", "a rule of dvtcli" if rule.source == "ours" else rule.source)
        if isinstance(rule, Rule):
            yield from (line for code in rule.aborts for line in _row("code", f"0x{code:08X}: {abort_text(code)}"))
        elif rule.hint:
            yield from _row("hint", rule.hint)


def _row(label: str, text: str) -> list[str]:
    """Return *text* after its *label*, in lines of at most 100 columns."""
    return wrap_text(text, 100, f"  {label:<7}  ", " " * 11).splitlines()
