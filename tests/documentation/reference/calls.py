"""Which call of the Python API does what a command does: by its name, by the API's own table, by `calls.toml`."""

from __future__ import annotations

import inspect
import re
import tomllib
from collections import defaultdict
from collections.abc import Iterator
from itertools import chain
from pathlib import Path

import click

import dvtcli
from tests.documentation.reference.commands import command
from tests.documentation.reference.markdown import code, table
from tests.documentation.reference.product import task_sections

#: a form of a command, in Markdown -> its calls
FORMS: dict[str, str] = tomllib.loads(Path(__file__).with_suffix(".toml").read_text("utf-8"))
#: whose calls there are, and how a program names that
OWNERS = {"node": dvtcli.Node, "bus": dvtcli.Bus, "bus.lss": dvtcli.Lss, "dvtcli": dvtcli}
#: commands whose call has another name, or chooses another call by a word or an option
CALLS = {
    "apply": "bus.apply",
    "pdo": "node.pdos",
    "node": "node.identity",
    "diff": "bus.plan",
    "eds add": "dvtcli.add_eds",
    "eds check": "dvtcli.check_eds",
    "eds convert": "dvtcli.convert",
    "eds list": "dvtcli.eds_library",
    "faults --clear": "node.clear_faults",
    "import": "bus.import_network",
    "lss assign": "bus.lss.assign",
    "lss bitrate": "bus.lss.bit_rate",
    "lss identify": "bus.lss.identify",
    "lss node-id": "bus.lss.node_id",
    "lss scan": "bus.lss.scan",
    "lss select": "bus.lss.select",
    "lss store": "bus.lss.store",
    "profiles": "dvtcli.profiles",
    "profiles show": "dvtcli.profile",
    "recover --finish": "bus.finish_stores",
    "save": "bus.script",
    "sync --check": "bus.check_sync",
}
_ALIKE = {"node": "the method of `Node` with that name", "bus": "the method of `Bus` with that name"}
_NONE = "none: run the command from your program, with `--json` for the answer"


def by_command() -> Iterator[str]:
    """Every command with its call, those whose call is called as they are first, and those without one last."""
    alike: defaultdict[str, list[str]] = defaultdict(list)
    others = dict(FORMS)
    without: list[str] = []
    for name in chain.from_iterable(map(forms, command_names())):
        owner, _, called = (call(name) or "").rpartition(".")
        if owner in _ALIKE and called == name:
            alike[owner].append(code(name))
        elif owner:
            others.setdefault(code(name), code(f"{owner}.{called}()"))
        elif code(name) not in FORMS:
            without.append(code(name))
    rows = [(" ".join(alike[owner]), said) for owner, said in _ALIKE.items()]
    rows += sorted(others.items(), key=lambda row: re.sub(r"\W+", " ", row[0]))
    return table(("command", "call"), [*rows, (" ".join(without), _NONE)])


def command_names() -> list[str]:
    """Every command, sorted."""
    return sorted(name for _, rows in task_sections() for name, _ in rows)


def forms(name: str) -> list[str]:
    """The command *name*, or that with each of its actions, where some of them have calls of their own."""
    own = [one for one in CALLS if one.split()[0] == name]
    actions = [one for one in own if len(one.split()) > 1 and "--" not in one]
    if not actions:
        return [*own, *([name] if name not in own else [])]
    first = command(name).params[0]
    assert isinstance(first.type, click.Choice)
    return [*(one for one in own if one not in actions), *(f"{name} {one}" for one in first.type.choices)]


def call(form: str) -> str | None:
    """The call for a *form* of a command: what the table says it is, else the method of that name; None without."""
    kinds = OWNERS.items()
    return CALLS.get(form) or next(
        (f"{owner}.{form}" for owner, kind in kinds if inspect.isfunction(getattr(kind, form, None))), None
    )
