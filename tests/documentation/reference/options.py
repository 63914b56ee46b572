"""The global options, with their variables and keys of dvtcli.toml."""

from __future__ import annotations

from collections.abc import Iterator

import click

from tests.documentation.reference.commands import ROOT_CONTEXT
from tests.documentation.reference.markdown import code, plain
from tests.documentation.reference.markdown import table as markdown_table
from tests.documentation.reference.product import ALIASES, PASSCODE, PREFIX, REGISTRY, START_ONLY, USERS_OWN


def options() -> list[tuple[str, click.Option]]:
    """The global options by their plain names."""
    return [
        (option.name.removeprefix(PREFIX), option)
        for option in REGISTRY.params
        if isinstance(option, click.Option) and not option.hidden and option.name and option.name.startswith(PREFIX)
    ]


def table() -> Iterator[str]:
    """Each option with what it means, and whether a line may have it."""
    return markdown_table(("option", "means", "given"), (_row(option) for _, option in options()))


def _row(option: click.Option) -> tuple[str, str, str]:
    record = option.get_help_record(ROOT_CONTEXT)
    assert record is not None
    name = (option.name or "").removeprefix(PREFIX)
    when = "at the start" if name in START_ONLY else "per line"
    return code(record[0]), plain(record[1]), when


def settings() -> Iterator[str]:
    """Each key of a settings file with its variable, its option, and the files that may have it."""
    spelled = {name: code(option.opts[-1]) for name, option in options()}  # of --json and --format the latter
    rows = [_key(name, f"DVTCLI_{name.upper()}", option) for name, option in spelled.items()]
    rows.append(_key(PASSCODE, "DVTCLI_PASSCODE", "none: process lists would show it"))
    rows.append(_key(f"[{ALIASES}]", "", "none"))
    return markdown_table(("key", "variable", "option", "in"), rows)


def _key(name: str, variable: str, option: str) -> tuple[str, str, str, str]:
    files = "`config.toml` only" if name in USERS_OWN else "both"
    if name == "bus":
        files = "both, as tables `[bus.NAME]`"
    return code(name), code(variable), option, files
