"""`watch` at a terminal, and its keys. Knows prompt_toolkit; what they do to the picture is the others'."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from prompt_toolkit.key_binding import KeyBindings

from dvtcli.cli.monitor.full_screen import bind, bind_leaving, show
from dvtcli.cli.monitor.monitor_state import GRAPH, TABLE, View
from dvtcli.cli.monitor.watch_app import WatchScreen

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation
    from dvtcli.cli.monitor.watch_screen import WatchedPdo
    from dvtcli.operations.frames.watch_bus import Watched
    from dvtcli.operations.objects.watch_objects import ObjectRound


def watch_screen(
    session: Conversation,
    watched: Watched,
    objects: ObjectRound,
    pdos: Sequence[WatchedPdo],
    every_s: float,
    duration_s: float | None,
) -> None:
    """Show *objects* and *pdos* until q, Ctrl-C or the end of *duration_s*; BusUnavailable as the monitor."""
    screen = WatchScreen(watched, objects, pdos, every_s, View(plain=session.output.plain))
    show(session, screen, _keys(screen), duration_s)


def _keys(screen: WatchScreen) -> KeyBindings:
    keys, view = KeyBindings(), screen.view

    def look(mode: str) -> None:
        view.mode = TABLE if view.mode == mode else mode
        view.top = 0

    bind(keys, screen.pause, "p", " ")
    bind(keys, lambda: look(GRAPH), "g", "enter")
    bind(keys, lambda: look(TABLE), "t", "escape")
    bind(keys, lambda: screen.choose(-1), "up", "k")
    bind(keys, lambda: screen.choose(1), "down", "j")
    bind(keys, lambda: screen.choose(-10), "pageup")
    bind(keys, lambda: screen.choose(10), "pagedown")
    bind(keys, screen.read_mappings, "m")
    bind(keys, screen.board.forget, "c")
    bind_leaving(keys)
    return keys
