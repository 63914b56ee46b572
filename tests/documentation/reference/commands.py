"""The commands, from what click knows of them; and the DVT's words, from their table."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator

import click

from tests.documentation.reference.markdown import code, fenced, plain, table
from tests.documentation.reference.product import REGISTRY, WORDS, task_sections

ROOT_CONTEXT = click.Context(REGISTRY, info_name="dvtcli")


#: What each task's commands promise, for README.
PROMISES = {
    "Begin": "each check names the next step",
    "Find nodes": "changes reach only the selected node; a TOML file describes your own device",
    "See": "raw values with names from the EDS; frames decoded by the nodes' mappings",
    "Change PDOs": "checked, written in order, read back, and rolled back after a failure",
    "Frames": "every bit is explained; a question comes before frames that nodes act on",
    "Check and keep": "nothing is called stored or equal without a read-back",
    "Whole devices": "one pass over all readable objects; values are compared by meaning",
    "Networks": "all nodes get the values of one file, or none; no consumer receives a layout that does not fit",
    "Scripts and files": "a whole script is parsed before its first line runs; exit codes and JSON are stable",
    "Programs around": "other programs use the same strict devices, over socketcand or a CAN link",
}


def tasks() -> Iterator[str]:
    """Every task with its commands and what they promise."""
    return table(
        ("task", "commands", "result"),
        ((task, " ".join(code(name) for name, _ in rows), PROMISES[task]) for task, rows in task_sections()),
    )


def by_task() -> Iterator[str]:
    """Every command with its sentence and its first example, by task."""
    for task, rows in task_sections():
        yield from ("", f"**{task}**", "")
        yield from table(
            ("command", "does", "example"),
            ((f"[`{name}`](#{name})", plain(sentence), code(examples(name)[0][0])) for name, sentence in rows),
        )


def every_command() -> Iterator[str]:
    """A section for each command: its sentence, grammar, options and examples."""
    for _, rows in task_sections():
        for name, sentence in rows:
            yield from ("", f"## {name}", "", plain(sentence), "")
            yield from _command(name)


def _command(name: str) -> Iterator[str]:
    found = command(name)
    ctx = click.Context(found, info_name=name)
    pieces = " ".join(found.collect_usage_pieces(ctx)).replace("[OPTIONS]", "").split()
    own = [(option, record) for option in found.params if (record := own_record(option, ctx)) is not None]
    yield from fenced("text", [" ".join([name, *(["[OPTIONS]"] if own else []), *pieces])])
    yield ""
    prose = inspect.cleandoc(found.help or "").partition("\b\n")[0].strip()
    if prose != inspect.cleandoc(found.short_help or ""):
        yield from (plain(paragraph) + "\n" for paragraph in re.split(r"\n\s*\n", prose))
    if own:
        yield from table(("option", "means"), ((code(record[0]), plain(record[1])) for _, record in own))
        yield ""
    yield from fenced(
        "text", (" ".join([line.ljust(44) + "  # " + why]) if why else line for line, why in examples(name))
    )


def own_record(option: click.Parameter, ctx: click.Context) -> tuple[str, str] | None:
    """How click shows an *option* of the command's own; None for arguments and hidden ones."""
    return option.get_help_record(ctx) if isinstance(option, click.Option) else None


def command(name: str) -> click.Command:
    """The command *name*."""
    found = REGISTRY.get_command(ROOT_CONTEXT, name)
    assert found is not None, name
    return found


def examples(name: str) -> list[tuple[str, str]]:
    """The lines of a command's example block, each with the words that explain it."""
    block = inspect.cleandoc(command(name).help or "").partition("\b\n")[2]
    parts = (re.split(r"\s{3,}", line.strip(), maxsplit=1) for line in block.splitlines() if line.strip("\b\n "))
    return [(part[0], part[1] if len(part) > 1 else "") for part in parts]


def dvt_words() -> Iterator[str]:
    """The DVT's words, each with its modern form."""
    return table(
        ("word", "does", "modern form"),
        ((code(word.grammar), plain(word.summary), code(word.modern)) for word in WORDS.values()),
    )
