"""Contents of prompt and toolbar: bus, node and unstored changes as (style, text) pairs; reads nothing from the bus."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import click

from dvtcli.cli.prompt.line import cut, expanded, last_line, typed_line
from dvtcli.cli.registry import REGISTRY
from dvtcli.domain.emergency_codes import emergency_text
from dvtcli.domain.nmt import NmtState
from dvtcli.domain.text import ascii_only, safe
from dvtcli.errors import DvtcliError
from dvtcli.watch.statistics import HIGH_LOAD

if TYPE_CHECKING:
    from prompt_toolkit.formatted_text import StyleAndTextTuples

    from dvtcli.cli.conversation import Conversation
    from dvtcli.cli.prompt.bus_watch import Life
    from dvtcli.device.node import Node


def syntax(text: str, width: int, aliases: Mapping[str, str]) -> tuple[str, str] | None:
    """Return the command at the start of *text* and its parameters in *width* columns; None without a command.

    Options not yet typed take precedence.
    """
    command = cut(last_line(text))[0]
    if not (before := typed_line(command)) or not before.words:
        return None
    line = typed_line(expanded(command, aliases))
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
    """Return a command's arguments as typed, and its options: `[--cob-id ID]` with their words."""
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


#: The separator of parts.
BETWEEN = " │ "


@dataclass(frozen=True, slots=True)
class StatusPart:
    """A piece of a status line: *forms* from longest to shortest, `""` if optional.

    Parts with lower *weight* are shortened first.
    """

    weight: int
    style: str
    forms: tuple[str, ...]


def fitted(parts: Sequence[StatusPart], width: int) -> list[tuple[str, str]]:
    """Return (style, text) of parts within *width* columns, each in the longest form that fits."""
    forms = [0] * len(parts)

    def texts() -> list[tuple[str, str]]:
        chosen = [(part.style, part.forms[form]) for part, form in zip(parts, forms, strict=True)]
        return [(style, text) for style, text in chosen if text]

    for number in sorted(range(len(parts)), key=lambda number: parts[number].weight):
        while _columns(texts()) > width and forms[number] < len(parts[number].forms) - 1:
            forms[number] += 1
    return texts()


def _columns(texts: Sequence[tuple[str, str]]) -> int:
    return 1 + sum(len(text) for _, text in texts) + len(BETWEEN) * max(0, len(texts) - 1)


_STATE_STYLES = {NmtState.OPERATIONAL: "class:good", NmtState.PRE_OPERATIONAL: "class:careful"}
#: Maximum number of a simulated node's PDOs to read before a prompt, for the menu.
MOST_PDOS_READ = 32


class Status:
    """The session as shown by the prompt; *life* watches the bus."""

    def __init__(self, session: Conversation, life: Life) -> None:
        self._session = session
        self._life = life
        #: the selected node's state as last read, if none is received
        self._told: NmtState | None = None

    def refresh(self, *, ask: bool) -> None:
        """Update the node's state before a prompt; *ask*: the node may be read, having just answered.

        On a real bus only a family's state object is read, to keep the prompt fast; the menu then shows values read by
        commands.
        """
        self._told = None
        node = self._node()
        if node is None or not ask:
            return
        try:
            self._told = node.access.state()
            if not self._session.wire.simulated:
                return
            present = node.present_known()
            if len(present) <= MOST_PDOS_READ and not node.last_read.keys() >= set(present):
                node.known_pdos()
        except DvtcliError:
            return  # the menu says less; the next command says why

    def prompt(self) -> str:
        """`can0/5 PRE-OP*> `."""
        node_id = self._session.selected_id()
        where = self._bus_name() + ("" if node_id is None else f"/{node_id}")
        state = self._state()
        words = [where, *([state.short] if state is not None else [])]
        if self._session.dry_run:
            words.append("DRY-RUN")
        if (tcl := self._session.tcl) is not None and tcl.on:
            words.append("tcl ..." if tcl.continues else "tcl")
        return safe(" ".join(words)) + ("*" if self.unstored() else "") + "> "

    def unstored(self) -> dict[int, list[str]]:
        """Return unstored changes by node-ID."""
        return {node.node_id: list(node.unstored) for node in self._nodes() if node.unstored}

    def toolbar(self, width: int, line: str = "") -> StyleAndTextTuples:
        """Return bus, load, node, state, emergencies and unstored changes on a line of *width* columns.

        Above it, the syntax of the command in *line*, if any.
        """
        parts = [self._bus_part(), *self._load_parts(), *self._node_parts(), *self._unstored_parts(), *self._hints()]
        fragments: StyleAndTextTuples = []
        command = syntax(line, width - 1, self._session.aliases)
        if command is not None:
            fragments += [("class:command", f" {safe(command[0])} "), ("", f"{safe(command[1])}\n")]
        for number, (style, text) in enumerate(fitted(parts, width)):
            fragments += [("", BETWEEN if number else " "), (style, text)]
        if self._session.options.ascii:
            return [(fragment[0], ascii_only(fragment[1])) for fragment in fragments]
        return fragments

    def _bus_part(self) -> StatusPart:
        if self._life.failure is not None:
            return StatusPart(9, "class:bad", (f"{self._bus_name()} {self._life.failure}", self._life.failure))
        name = "SIMULATED" if self._session.wire.simulated else self._bus_name()
        return StatusPart(7, "", (f"{name} (dry run)", "dry run") if self._session.dry_run else (name, name[-12:]))

    def _load_parts(self) -> list[StatusPart]:
        load = self._life.load()
        if load is None:
            return []
        text = f"load {load:.0%}"
        return [StatusPart(5, "class:bad", (text,)) if load > HIGH_LOAD else StatusPart(3, "", (text, ""))]

    def _node_parts(self) -> list[StatusPart]:
        node_id, node = self._session.selected_id(), self._node()
        if node_id is None:
            return [StatusPart(8, "", ("no node selected", "no node"))]
        title = f" {safe(node.title[:24])}" if node is not None and node.title else ""
        parts = [StatusPart(2, "", (f"node {node_id}{title}", f"node {node_id}"))]
        silence = self._life.silence_s(node_id)
        state = self._state()
        if silence is not None and silence[1]:
            parts.append(StatusPart(9, "class:bad", (f"NO HEARTBEAT {silence[0]:.0f} s",)))
        elif state is None:
            parts.append(StatusPart(4, "", ("state unknown", "")))
        else:
            short = state.short
            beat = f"{short} HB {silence[0]:.1f} s" if silence is not None else short
            parts.append(StatusPart(4, _STATE_STYLES.get(state, "class:bad"), (beat, short)))
        return parts + self._emergency_parts(node_id)

    def _emergency_parts(self, node_id: int) -> list[StatusPart]:
        count, code = self._life.emergencies.get(node_id, (0, 0))
        if not count:
            return []
        said = f"EMCY {count}: 0x{code:04X}"
        return [StatusPart(5, "class:bad" if code else "", (f"{said} {emergency_text(code)}", said))]

    def _unstored_parts(self) -> list[StatusPart]:
        selected = self._session.selected_id()
        parts = []
        for node_id, labels in self.unstored().items():
            whose = "" if node_id == selected else f"node {node_id}: "
            forms = (f"{whose}{_listed(labels)} not stored", f"{whose}{len(labels)} not stored", "not stored")
            parts.append(StatusPart(6, "class:careful", forms))
        return parts

    def _hints(self) -> list[StatusPart]:
        from dvtcli.cli.catalogue import command_names

        return [StatusPart(1, "", ("F1 help", ""))] if "help" in command_names() else []

    def _bus_name(self) -> str:
        """The name given with `--bus`, else the channel."""
        if self._session.base.bus is not None:
            return self._session.base.bus
        name = self._session.wire.name
        return name.partition(":")[2] or name

    def _state(self) -> NmtState | None:
        node_id = self._session.selected_id()
        if node_id is None:
            return None
        if self._session.dry_run:
            return self._told
        return self._life.states.get(node_id, self._told)

    def _node(self) -> Node | None:
        return self._session.seen_nodes().get(self._session.selected_id() or 0)

    def _nodes(self) -> list[Node]:
        return [*self._session.left_nodes(), *self._session.seen_nodes().values()]


def _listed(labels: list[str]) -> str:
    return ", ".join(labels[:3]) + (f", +{len(labels) - 3}" if len(labels) > 3 else "")
