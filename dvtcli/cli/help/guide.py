"""What `help` says: the commands by task, and topics, which are text files in `topics/`.

Knows commands by their names only. Does not know any command's options (click does).
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence

from dvtcli.cli.catalogue import command_names, summary, task

_TOPICS = os.path.join(os.path.dirname(__file__), "topics")  # noqa: PTH118, PTH120 - pathlib costs 7 ms

#: Tasks in the order in which they come up; which one a command belongs to, and where in it, its own file says.
TASKS = ("Begin", "Find nodes", "See", "Change PDOs", "Check and keep", "Scripts and files", "Programs around")


def by_task(names: Sequence[str]) -> Iterator[tuple[str, list[str]]]:
    """*names* in groups, each with its task, in the order of `TASKS` and in each of the places that their files say."""
    declared = sorted((*task(name), name) for name in names)
    for one in TASKS:
        group = [name for named, _, name in declared if named == one]
        if group:
            yield one, group


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
    width = max(map(len, TASKS))
    lines += [f"  {name:<{width}}  {'  '.join(group)}" for name, group in by_task(command_names())]
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
    for name_of_task, group in by_task(command_names()):
        yield name_of_task, [(name, summary(name)) for name in group]
