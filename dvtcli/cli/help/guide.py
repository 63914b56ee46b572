"""The output of `help`: commands by task, and topics, which are text files in `topics/`."""

from __future__ import annotations

from collections.abc import Mapping

from dvtcli.cli.catalogue import TASKS, task_rows

#: Names of the text files in `topics/`, sorted.
TOPICS = ("dvt", "network", "options", "writing")


def topic(name: str) -> str:
    """Return the text of topic *name*; the first line is its subject."""
    from importlib.resources import files

    return (files("dvtcli.cli.help") / "topics" / f"{name}.txt").read_text("utf-8").rstrip()


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
