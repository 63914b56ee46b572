"""The syntax of the command that is being typed, on one line. Knows click's parameters; does not know what they do."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache

import click

from dvtcli.cli.prompt.line import cut, expanded
from dvtcli.cli.prompt.typed import last_line, typed
from dvtcli.cli.registry import REGISTRY


def syntax(text: str, width: int, aliases: Mapping[str, str]) -> tuple[str, str] | None:
    """The command that *text* begins with and its parameters, in at most *width* columns; None where there is none.

    Options that were typed already give way to those that were not.
    """
    command = cut(last_line(text))[0]
    if not (before := typed(command)) or not before.words:
        return None
    line = typed(expanded(command, aliases))
    if line is None or not line.words:
        return None
    name = line.words[0].lower()
    arguments, options = _parts(name)
    if arguments is None:
        return None
    shown, left = list(arguments), [part for part in options if not set(part[1]) & set(line.words)]
    for number, (part, _) in enumerate(left):
        more = " …" if number < len(left) - 1 else ""
        if len(" ".join([name, *shown, part])) + len(more) > width:
            shown.append("…")
            break
        shown.append(part)
    return name, " ".join(shown)[: max(0, width - len(name) - 1)]


@lru_cache(maxsize=64)
def _parts(name: str) -> tuple[tuple[str, ...] | None, tuple[tuple[str, tuple[str, ...]], ...]]:
    """A command's arguments as they are typed, and its options: `[--cob-id ID]` with the words that give it."""
    command = REGISTRY.get_command(click.Context(REGISTRY), name)
    if command is None:
        return None, ()
    ctx = click.Context(command, info_name=name)
    arguments = tuple(
        piece
        for parameter in command.get_params(ctx)
        if isinstance(parameter, click.Argument)
        for piece in parameter.get_usage_pieces(ctx)
    )
    options = tuple(
        (_option(option, ctx), (*option.opts, *option.secondary_opts))
        for option in command.get_params(ctx)
        if isinstance(option, click.Option) and not option.hidden and "--help" not in option.opts
    )
    return arguments, options


def _option(option: click.Option, ctx: click.Context) -> str:
    words = "|".join([max(option.opts, key=len), *option.secondary_opts])
    takes = "" if option.is_flag or option.count else f" {option.make_metavar(ctx)}"
    return f"[{words}{takes}]"
