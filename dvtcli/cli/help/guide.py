"""What `help` says: the commands by task, and topics, which are text files in `topics/`.

Knows commands by their names only. Does not know any command's options (click does).
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence

from dvtcli.cli.catalogue import command_names, summary

_TOPICS = os.path.join(os.path.dirname(__file__), "topics")  # noqa: PTH118, PTH120 - pathlib costs 7 ms

#: Tasks in the order in which they come up, with the commands for each; a command in none of them is shown as a rest.
TASKS: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("Begin", ("tour", "doctor", "help", "exit")),
    ("Find nodes", ("scan", "node", "nmt", "login", "profiles", "eds")),
    ("See", ("pdo", "objects", "read", "monitor", "decode", "plot", "log", "trace")),
    ("Change PDOs", ("map", "set", "enable", "disable", "clear", "vpdo", "write", "link")),
    ("Check and keep", ("verify", "sync", "store", "restore", "undo", "recover", "backup")),
    ("Scripts and files", ("run", "save", "require", "export", "plan", "diff", "apply", "check", "load")),
    ("Programs around", ("sim", "completion")),
)


def by_task(names: Sequence[str]) -> Iterator[tuple[str, list[str]]]:
    """*names* in groups, each with its task; what belongs to none comes last."""
    placed: set[str] = set()
    for task, members in TASKS:
        group = [name for name in members if name in names]
        placed.update(group)
        if group:
            yield task, group
    rest = [name for name in names if name not in placed]
    if rest:
        yield "More", rest


def topic_names() -> list[str]:
    """Names of all topics, sorted."""
    return sorted(name.removesuffix(".txt") for name in os.listdir(_TOPICS) if name.endswith(".txt"))  # noqa: PTH208


def topic(name: str) -> str:
    """The text of topic *name*; its first line is what it is about."""
    with open(os.path.join(_TOPICS, f"{name}.txt"), encoding="utf-8") as file:  # noqa: PTH118, PTH123
        return file.read().rstrip()


def overview(aliases: Mapping[str, str] | None = None) -> list[str]:
    """The first screen of help: every command by task, the topics, the *aliases*, and where to begin."""
    lines = ["Commands, by task:"]
    width = max(len(task) for task, _ in TASKS)
    lines += [f"  {task:<{width}}  {'  '.join(group)}" for task, group in by_task(command_names())]
    lines += ["", "Topics:"]
    lines += [f"  {name:<{width}}  {topic(name).splitlines()[0]}" for name in topic_names()]
    lines += ["", "Aliases, at the prompt:"] if aliases else []
    lines += [f"  {word:<{width}}  {text}" for word, text in sorted((aliases or {}).items())]
    lines += [
        "",
        "help NAME     a command with examples, or a topic",
        "help --all    what each command does, and the global options",
    ]
    return lines


def task_sections() -> Iterator[tuple[str, list[tuple[str, str]]]]:
    """Every command with its one-line help, by task."""
    for task, group in by_task(command_names()):
        yield task, [(name, summary(name)) for name in group]
