"""The monitor at a terminal, and its keys. Knows prompt_toolkit; what they do to the picture is the others'."""

from __future__ import annotations

from typing import TYPE_CHECKING

from prompt_toolkit.filters import Condition
from prompt_toolkit.key_binding import KeyBindings

from dvtcli.cli.monitor.app import Monitor
from dvtcli.cli.monitor.full_screen import bind, bind_leaving, show
from dvtcli.cli.monitor.monitor_state import GRAPH, RAW, TABLE, View

if TYPE_CHECKING:
    from prompt_toolkit.key_binding import KeyPressEvent

    from dvtcli.cli.conversation import Conversation
    from dvtcli.operations.frames.watch_bus import Watched


def watch(session: Conversation, watched: Watched, wanted: str, duration_s: float | None, *, changes: bool) -> None:
    """Show the bus until q, Ctrl-C or the end of *duration_s*; BusUnavailable where it failed and is not waited for."""
    view = View(filter=wanted, plain=session.output.plain, changes=changes)
    monitor = Monitor(session.wire.name, watched, view)
    show(session, monitor, _keys(monitor), duration_s)


def _keys(monitor: Monitor) -> KeyBindings:
    """What each key does."""
    keys, view = KeyBindings(), monitor.view

    def typing() -> bool:
        return view.typing

    bind(keys, monitor.pause, "p", " ", unless=typing)
    bind(keys, monitor.read_mappings, "m", unless=typing)
    bind(keys, lambda: _look(view, RAW), "r", unless=typing)
    bind(keys, lambda: _look(view, GRAPH), "g", "enter", unless=typing)
    bind(keys, lambda: _look(view, TABLE), "t", "escape", unless=typing)
    bind(keys, lambda: monitor.choose(-1), "up", "k", unless=typing)
    bind(keys, lambda: monitor.choose(1), "down", "j", unless=typing)
    bind(keys, lambda: monitor.choose(-10), "pageup", unless=typing)
    bind(keys, lambda: monitor.choose(10), "pagedown", unless=typing)
    bind(keys, monitor.store.forget, "c", unless=typing)
    bind(keys, lambda: _type(view), "f", "/", unless=typing)
    bind_leaving(keys, unless=typing)
    _typing_keys(keys, view)
    return keys


def _look(view: View, mode: str) -> None:
    """Show *mode*; the same key again goes back to the table."""
    view.mode = TABLE if view.mode == mode else mode
    view.top = view.beyond = 0


def _type(view: View) -> None:
    view.typing = True


def _typing_keys(keys: KeyBindings, view: View) -> None:
    """The keys of the filter's line."""
    typing = Condition(lambda: view.typing)

    def change(text: str) -> None:
        view.filter, view.chosen, view.top, view.beyond = text, 0, 0, 0

    @keys.add("<any>", filter=typing)
    def _letter(event: KeyPressEvent) -> None:
        """One more letter."""
        if event.data.isprintable():
            change(view.filter + event.data)

    @keys.add("backspace", filter=typing)
    def _shorter(_event: KeyPressEvent) -> None:
        """One letter less."""
        change(view.filter[:-1])

    @keys.add("enter", filter=typing)
    def _keep(_event: KeyPressEvent) -> None:
        """Keep the filter."""
        view.typing = False

    @keys.add("escape", filter=typing)
    def _clear(_event: KeyPressEvent) -> None:
        """No filter."""
        view.typing = False
        change("")
