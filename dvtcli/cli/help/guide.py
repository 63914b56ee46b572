"""The output of `help`: commands by task, and topics, which are text files in `topics/`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from dvtcli.cli.catalogue import TASKS, by_task, command_names

#: width of help (columns)
_WIDTH = 80
#: Names of the text files in `topics/`, sorted.
TOPICS = ("dvt", "network", "options", "writing")


def topic(name: str) -> str:
    """Return the text of topic *name*; the first line is its subject."""
    from importlib.resources import files

    return (files("dvtcli.cli.help") / "topics" / f"{name}.txt").read_text("utf-8").rstrip()


def _rows(names: Sequence[str], width: int) -> list[str]:
    """Arrange *names* in rows of at most *width* columns."""
    rows = [""]
    for name in names:
        longer = f"{rows[-1]}  {name}" if rows[-1] else name
        if len(longer) > width and rows[-1]:
            rows.append(name)
        else:
            rows[-1] = longer
    return rows


def overview(aliases: Mapping[str, str] | None = None) -> list[str]:
    """Return the first screen of help: commands by task, topics, *aliases*, and first steps."""
    lines = ["Commands, by task:"]
    width = max(map(len, TASKS))
    for name, group in by_task(command_names()):
        rows = _rows(group, _WIDTH - width - 4)
        lines += [f"  {name if row is rows[0] else '':<{width}}  {row}" for row in rows]
    lines += ["", "Topics:"]
    lines += [f"  {name:<{width}}  {topic(name).splitlines()[0]}" for name in TOPICS]
    lines += ["", "Aliases, at the prompt:"] if aliases else []
    lines += [f"  {word:<{width}}  {text}" for word, text in sorted((aliases or {}).items())]
    lines += [
        "",
        "help NAME     a command with examples, or a topic",
        "help --all    what each command does, and the global options",
    ]
    return lines
