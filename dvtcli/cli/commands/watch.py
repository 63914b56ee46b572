"""Watch chosen objects and PDOs on a full screen: values, changes, ages and trends."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand, Effect
from dvtcli.cli.object_params import OBJECT, Objects, ObjectWord
from dvtcli.cli.params import CanopenType, DurationType
from dvtcli.cli.pdo_params import NodePdo, PdoType
from dvtcli.operations.user.refused_options import refuse_options

if TYPE_CHECKING:
    from collections.abc import Sequence

    from click.shell_completion import CompletionItem

    from dvtcli.cli.conversation import Conversation
    from dvtcli.operations.results import ValuesWatched

_PDO = re.compile(r"(?:\d+:)?[rt]pdo\d+", re.IGNORECASE | re.ASCII)


class _WatchedType(CanopenType):
    """An object, or a PDO: `606C`, `3:6041`, `tpdo1`, `3:tpdo1`."""

    name = "object"

    def parse(self, text: str, ctx: click.Context | None) -> object:
        """The word; ValueError as for an object or a PDO."""
        return (PdoType() if _PDO.fullmatch(text) else OBJECT).parse(text, ctx)

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """Offer PDOs, then objects."""
        pdos = PdoType().shell_complete(ctx, param, incomplete) if incomplete[:1].lower() in ("t", "r") else []
        return [*pdos, *OBJECT.shell_complete(ctx, param, incomplete)]


@click.command("watch", cls=DvtCommand, short_help=__doc__, effect=Effect.NONE)
@click.argument("words", cls=Objects, type=_WatchedType(), metavar="OBJECT|PDO…", nargs=-1, required=True)
@click.option("--every", "every_s", type=DurationType(), metavar="TIME", help="Time between two readings [500ms].")
@click.option("--for", "for_s", type=DurationType(), metavar="TIME", help="End after TIME [until q or Ctrl-C].")
@click.pass_obj
def command(
    session: Conversation,
    /,
    words: tuple[ObjectWord | NodePdo, ...],
    every_s: float | None,
    for_s: float | None,
) -> ValuesWatched | None:
    """Show the values of OBJECTs, read by SDO repeatedly, and of PDOs, as their frames arrive.

    At a terminal, `watch` is a full screen with its keys at the bottom; * marks a value that has just changed. Without
    a terminal, or with --json, it prints objects as `read OBJECT… --every` does; PDOs need the screen, or `monitor`.
    `watch` only reads; the key m reads the PDOs' mappings again.

    \b
    watch 6041 606C --for 1s
    watch 606C 3:6041 tpdo1 3:tpdo2 --every 100ms
    """
    from dvtcli.cli.each_node import selected_objects
    from dvtcli.cli.screen.full_screen import has_full_screen

    objects = [word for word in words if isinstance(word, ObjectWord)]
    pdos = [word for word in words if isinstance(word, NodePdo)]
    if not objects:
        refuse_options({"every": every_s}, "for objects only: PDOs are shown as their frames arrive")
    if has_full_screen(session):
        _on_screen(session, objects, pdos, every_s or _EVERY_S, for_s)
        return None
    if pdos:
        raise click.UsageError("PDOs are watched on a full screen, which needs a terminal; here `monitor` shows frames")
    from dvtcli.operations.objects.watch_objects import watch_objects

    return watch_objects(session, selected_objects(session, objects), every_s or _EVERY_S, for_s, session.output.stream)


_EVERY_S = 0.5


def _on_screen(
    session: Conversation,
    objects: Sequence[ObjectWord],
    pdos: Sequence[NodePdo],
    every_s: float,
    for_s: float | None,
) -> None:
    from dvtcli.cli.each_node import selected_objects
    from dvtcli.cli.monitor.watch import watch_screen
    from dvtcli.operations.frames.watch_bus import watching
    from dvtcli.operations.objects.watch_objects import ObjectRound

    wanted = [(session.node_id() if word.node_id is None else word.node_id, word.pdo.label) for word in pdos]
    nodes = tuple(dict.fromkeys(node_id for node_id, _ in wanted))
    found = ObjectRound(session, selected_objects(session, objects))
    with watching(session, nodes, known=False) as watched:
        watch_screen(session, watched, found, wanted, every_s, for_s)
