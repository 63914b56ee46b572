"""Show the traffic on the bus, decoded, with rate, jitter, minimum and maximum; in a pipe as JSON."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand, Effect
from dvtcli.cli.commands._frame_options import only_option
from dvtcli.cli.params import FILE, TEXT, DurationType, NodesType

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from dvtcli.cli.conversation import Conversation
    from dvtcli.cli.view.output import Output
    from dvtcli.operations.results import FrameSeen
    from dvtcli.operations.results.frames import BusEvent
    from dvtcli.operations.session.open_network import OnBusEvent


@click.command("monitor", cls=DvtCommand, short_help=__doc__, effect=Effect.NONE)
@click.option("--nodes", type=NodesType(), metavar="ID,…", help="Nodes whose mappings are read [nodes that send].")
@click.option(
    "-d",
    "--dbc",
    "--decode",
    "dbc",
    type=FILE,
    metavar="FILE",
    help="Decode by a DBC or network file (after --nodes, if given).",
)
@click.option("--filter", "wanted", type=TEXT, metavar="TEXT", help="Only frames and signals with TEXT in their names.")
@only_option
@click.option("--duration", "--for", "duration", type=DurationType(), metavar="TIME",
              help="End after TIME (300ms, 5s, 2min).")  # fmt: skip
@click.option("--changes", is_flag=True, help="Only frames whose data changed.")
@click.pass_obj
def command(
    session: Conversation,
    /,
    nodes: tuple[int, ...] | None,
    dbc: str | None,
    wanted: str | None,
    only: frozenset[str] | None,
    duration: float | None,
    changes: bool,
) -> None:
    """Watch the bus: PDOs decoded by the mapping that the nodes hold, EMCY and NMT, until q or Ctrl-C.

    At a terminal it is a full screen, with its keys at the bottom; else one dvtcli.frame/1 document a line. It reads
    the mappings by SDO upload, once, at the start, and again with m. Only keys send: n NMT, y SYNC, x a transmit
    list, asked about as send asks. A node that does not answer shows its frames as bytes. If the bus is gone,
    monitor waits for it, says so, and reads the mappings again; --no-reconnect ends with 5.

    \b
    monitor
    monitor --nodes 1,5 --filter velocity
    monitor --dbc drive.dbc --changes
    monitor --duration 10 --json
    """
    from dvtcli.cli.screen.full_screen import has_full_screen
    from dvtcli.operations.frames.watch_bus import stream, watching

    full_screen = has_full_screen(session)
    with watching(session, nodes or (), dbc, known=not full_screen) as watched:
        if full_screen:
            from dvtcli.cli.monitor.monitor_keys import watch
            from dvtcli.cli.monitor.signal_lines import View

            view = View(filter=wanted or "", plain=session.output.plain, changes=changes, only=only or frozenset())
            watch(session, watched, view, duration)
        else:
            show, on_bus_event = _shown_by(session.output), _on_bus_event(session.output)
            stream(
                watched,
                show,
                (wanted or "").lower(),
                duration,
                changes=changes,
                only=only or frozenset(),
                on_bus_event=on_bus_event,
            )


def _shown_by(output: Output) -> Callable[[Iterable[FrameSeen]], None]:
    from dvtcli.cli.view.answers.frame_lines import FrameJson

    lines = FrameJson(output.encoder())

    def show(seen: Iterable[FrameSeen]) -> None:
        if texts := list(map(lines.text, seen)):
            output.json_lines(("\n".join(texts),))  # what has arrived, in one call

    return show


def _on_bus_event(output: Output) -> OnBusEvent:
    """Report a lost or restored bus as a document among the frames; without --json also as a line of text."""

    def report(event: BusEvent) -> None:
        output.documents([event.document()])
        if not output.json:
            output.lines([event.text])

    return report
