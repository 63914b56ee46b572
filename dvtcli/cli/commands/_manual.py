"""The manual page, in roff, from the same words as `help`. Does not know how it is shown."""

from __future__ import annotations

import inspect
from collections.abc import Iterator

import click

from dvtcli.cli.catalogue import task_sections
from dvtcli.cli.help.guide import TOPICS, topic


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
