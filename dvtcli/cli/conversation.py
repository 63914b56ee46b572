"""A session with a terminal: lines, scripts and their options follow one another. Click passes it to commands."""

from __future__ import annotations

import io
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Protocol

import click

from dvtcli.errors import DvtcliError, State, UsageError
from dvtcli.operations.session.session import Session
from dvtcli.operations.user.options import NO_TERMINAL, START_ONLY, Options

if TYPE_CHECKING:
    from dvtcli.cli.scripts.script_changes import ScriptChanges
    from dvtcli.cli.scripts.script_report import ScriptReport
    from dvtcli.cli.view.output import Output
    from dvtcli.cli.view.typed_hints import TypedCall
    from dvtcli.domain.hint import Hint
    from dvtcli.domain.object_dictionary import ObjectDictionary
    from dvtcli.domain.ports import Frame
    from dvtcli.domain.profile import DeviceProfile
    from dvtcli.operations.results.frames import BusEvent
    from dvtcli.operations.session.open_network import OpenBus

#: The options that a follow-up command needs for the same nodes, with their letters.
_REPEATED = {
    "interface": "-i", "channel": "-c", "bitrate": "-b", "bus_kwargs": "--bus-kwargs", "bus": "--bus", "sim": "--sim",
    "eds": "--eds", "profile": "-p", "journal": "--journal",
}  # fmt: skip


def typed_name(name: str) -> str:
    """Return the option *name* as typed."""
    return f"--{name.replace('_', '-')}"


def _repeated(given: dict[str, Any]) -> Iterator[str]:
    """Return the options of *given* that select the bus and the node's files, as typed."""
    for name, option in _REPEATED.items():
        value = given.get(name, ())
        for word in value if type(value) is tuple else (value,):
            yield option
            yield str(word)


class CliReporter:
    """A `Reporter` that writes to *output*, and asks if *may_ask*() and a user is at the terminal."""

    unanswered = NO_TERMINAL

    def __init__(self, output: Output, may_ask: Callable[[], bool]) -> None:
        self._output = output
        self._may_ask = may_ask

    def note(self, text: Hint | str) -> None:
        """Show a message."""
        self._output.note(text)

    def warning(self, text: Hint | str) -> None:
        """Show a warning."""
        self._output.warning(text)

    def bus(self, event: BusEvent) -> None:
        """Report a lost or restored bus: as a document with --json, else on stderr, even with --quiet."""
        if self._output.json:
            self._output.documents([event.document()])
        else:
            self._output.lines([event.text])

    def instruct(self, text: str) -> None:
        """Show *text* unchanged, also with --quiet and --json."""
        self._output.lines([text])

    def ask(self, question: str) -> bool | None:
        """Ask at the terminal; returns None in a script, or without a terminal."""
        if not self._may_ask() or not (sys.stdin.isatty() and sys.stderr.isatty()):
            return None
        from dvtcli.bus.turns import in_callers_thread

        # Ctrl-C reaches the main thread alone: nodes that are asked side by side have threads of their own
        return in_callers_thread(lambda: self._output.ask(question))

    def confirm(self, question: str, word: str) -> bool | None:
        """Ask for *word* at the terminal; returns None in a script, or without a terminal."""
        if not self._may_ask() or not (sys.stdin.isatty() and sys.stderr.isatty()):
            return None
        from dvtcli.bus.turns import in_callers_thread

        return in_callers_thread(lambda: self._output.ask(question, word))

    def progress(self, text: str, done: int, total: int) -> None:
        """Show the progress of long work."""
        self._output.progress(text, done, total)

    def traffic(self, frame: Frame, *, sent: bool, secret: slice | None) -> None:
        """Show a frame."""
        self._output.traffic(frame, sent=sent, secret=secret)


class Conversation(Session):
    """The state of one run of dvtcli; calls *on_open* before opening the bus.

    *open_bus* is as in `Session`.
    """

    def __init__(
        self, output: Output, on_open: Callable[[], None] = lambda: None, *, open_bus: OpenBus | None = None
    ) -> None:
        super().__init__(reporter=CliReporter(output, lambda: not self.in_script), open_bus=open_bus)
        self.output = output
        output.call = self.typed_call
        self.on_open = on_open
        #: at the prompt and in scripts the bus is already chosen
        self.started = False
        #: whether a line was `exit`
        self.left = False
        #: whether a `require` failed
        self.requirement_failed = False
        #: the running scripts, outermost first
        self.scripts: list[str] = []
        #: the changes of the outermost script
        self.script_changes: ScriptChanges | None = None
        #: the report of a script's lines, if requested
        self.report: ScriptReport | None = None
        #: `FILE:LINE` of the current script line
        self.place: str | None = None
        #: whether nodes record all effects of the current line (reads and recorded writes only)
        self.is_noted = True
        #: whether to report the nodes' state if the current line is stopped
        self.tells_state = False
        #: whether the current line is read-only
        self.only_looks = False
        #: whether an answer of the current line leaves open if a node was changed
        self.may_have_changed = False
        #: numbers of writes to nodes before the current line
        self._written_before: dict[int, int] = {}
        #: whether lines are typed at the prompt
        self.at_prompt = False
        #: Tcl for its lines, None before the first Tcl line
        self.tcl: TypedTcl | None = None
        #: the user's aliases, with their expansions
        self.aliases: dict[str, str] = {}
        #: lines typed before, the newest last
        self.recent_lines: Callable[[], Sequence[str]] = tuple
        #: whether this is a rehearsal for another conversation, which reports bus events
        self._is_stage = False

    def read_settings(self, variables: dict[str, Any]) -> None:
        """Read the settings files, and options from the environment *variables*."""
        self.settings.read_files()
        self.settings.variables = {name: (value, f"DVTCLI_{name.upper()}") for name, value in variables.items()}

    def require_settings(self) -> None:
        """Raise errors and show warnings about settings, as in `Opened`, with the remedy."""
        for said in self.settings.required():
            self.output.warning(said)

    def start(self, given: dict[str, Any], where: str = "") -> None:
        """Set the program's options, typed or from *where*."""
        found = self.settings.start({name: (value, where or typed_name(name)) for name, value in given.items()})
        self.base = self.options = Options()._replace(**found)
        self._apply()

    def begin_line(self, *, is_noted: bool, tells_state: bool) -> None:
        """Begin a line of a command; a script's lines belong to the script's line."""
        self.acts()  # what was sent before is not this line's
        if self.in_script:
            self.is_noted &= is_noted
            return
        self.is_noted, self.tells_state, self._written_before = is_noted, tells_state, self.writes()

    def state_now(self) -> tuple[State, str | None]:
        """Return the known state of nodes if the current line ends without its answer; also in words."""
        written = {node for node, count in self.writes().items() if count != self._written_before.get(node, 0)}
        if self.is_noted and not written:
            return "unchanged", None
        if (
            self.is_noted
            and self.ends_with_line
            and all(node.history for node in self._nodes() if node.node_id in written)
        ):
            return "unknown", "written as planned and verified before that"
        return "unknown", None

    @property
    def in_script(self) -> bool:
        """Whether a script runs, which never asks, and keeps nodes pre-operational until its last line."""
        return bool(self.scripts)

    @property
    def ends_with_line(self) -> bool:
        """Whether the current command is the program's only command."""
        return not self.started and not self.in_script

    @contextmanager
    def line(self, given: dict[str, Any]) -> Iterator[None]:
        """Apply a line's own options while it runs, also to the lines of its script.

        If the line fails, its output options stay until `reset_output`, to show the error.
        """
        refused = sorted(START_ONLY & given.keys()) if self.started else []
        if refused:
            raise UsageError(
                f"{typed_name(refused[0])} sets the bus or the files of the node: give it at the start of dvtcli",
                hint="leave and start again with it; `node ID` selects another node of the same bus",
            )
        if not self.started:
            self.start(given)
        with self._under(given):
            self.cancellation.release()
            if self.cancellation.requested:  # between the lines of a script, or just before this one
                raise KeyboardInterrupt
            try:
                yield
            finally:
                self.cancellation.hold()  # a signal waits until the line's end is reached in order
        if (self.in_script or not self.started) and (nodes := self._nodes()):
            from dvtcli.device.node import refuse_after_restarts

            refuse_after_restarts(nodes)
        self.reset_output()

    def typed_call(self) -> TypedCall:
        """Return the options of this call that a follow-up command needs."""
        from dvtcli.cli.view.typed_hints import TypedCall

        given = {name: value for name, (value, where) in self.settings.typed.items() if where == typed_name(name)}
        nodes = given.get("node")
        word = ",".join(map(str, nodes)) if type(nodes) is tuple else str(nodes)
        return TypedCall(
            tuple(_repeated(given)),
            () if nodes is None else ("-n", word),
            self.selected_id(),
            alone=not self.at_prompt,
            script=next((file for file in self.scripts[:1] if file.lower().endswith(".dvt")), ""),
        )

    def doing(self) -> str:
        """Return the current command without its arguments, which may have a passcode."""
        line = click.get_current_context(silent=True)
        return "" if line is None else line.info_name or ""

    def reset_output(self) -> None:
        """Warn of events noticed during a line or its end, then reset the output options."""
        if not self._is_stage:
            self.warn_of_disturbances()
        if nodes := self._nodes():
            from dvtcli.device.node import losses
            from dvtcli.domain.hint import Action, Hint, verbatim

            for node in nodes:
                for text in losses([node]):
                    why = f"{verbatim(text)}; see {{}}"
                    self.output.warning(Hint(Action.VERIFY, {"node": node.node_id}, why))
        self._apply()

    def _apply(self) -> None:
        """Apply the present options to output and bus."""
        options = self.options
        self.output.configure(options.format, options.color, options.verbose, quiet=options.quiet, plain=options.ascii)
        super()._apply()

    def on_twins(self) -> Conversation:
        """Return a silent conversation on fresh twins of the nodes; it neither asks, stores nor sends."""
        from dataclasses import replace

        from dvtcli.cli.view.output import Output

        network = self.network
        stage = Conversation(Output(io.StringIO(), io.StringIO()))
        stage._is_stage = stage.started = True
        quiet = self.base._replace(dry_run=True, force=True, verbose=0, quiet=True, format="text")
        stage.base = stage.options = quiet
        stage.cancellation, stage.selected = self.cancellation, self.selected
        stage._network = replace(
            network, change_files=None, nodes={}, change_order=[], comes_back=False, left={},
            done_before=lambda _node_id: [], met=lambda: list(network.nodes),
        )  # fmt: skip
        return stage

    def offline_dictionaries(self) -> list[tuple[ObjectDictionary, DeviceProfile]]:
        """Return dictionaries with profiles known without a bus: --eds, and of simulated nodes."""
        from dvtcli.operations.session.device_files import offline_dictionaries

        return offline_dictionaries(self.base)

    def completion_dictionaries(self, node_id: int | None = None) -> list[tuple[ObjectDictionary, DeviceProfile]]:
        """Return dictionaries for completion: the open node's (None: the selected node), else offline ones."""
        if self._network is not None:
            node = self._network.nodes.get((self.selected_id() if node_id is None else node_id) or 0)
            if node is not None and node.dictionary is not None:
                return [(node.dictionary, node.profile)]
        return self.offline_dictionaries()

    def is_secret(self, line: str) -> bool:
        """Whether a typed *line* may hold a passcode; asks no bus."""
        return self.secrets.in_line(line, [node.dictionary for node in self._nodes() if node.dictionary is not None])

    def staying(self) -> tuple[str, ...]:
        """Return `FILE:LINE` of script lines whose changes are still in the nodes; empty under --dry-run."""
        return () if self.script_changes is None or self.dry_run else self.script_changes.staying()

    def stays_differing(self) -> tuple[str, ...] | None:
        """Read back how nodes differ from the lines of `staying`; None if unreadable or not read."""
        if self.script_changes is None or self.dry_run or self.cancellation.requested:
            return None
        try:
            return self.script_changes.differing()
        except DvtcliError:  # what failed is told; of this nothing is claimed
            return None


class TypedTcl(Protocol):
    """Lines of Tcl, and the mode for Tcl lines only."""

    on: bool

    @property
    def continues(self) -> bool:
        """Whether the next line continues the last."""

    def run(self, text: str) -> int:
        """Run a whole line; returns its exit code."""

    def typed(self, text: str) -> int:
        """Run a line typed in the mode, or keep it until complete; returns its exit code."""

    def leave(self) -> None:
        """Leave the mode."""

    def forget(self) -> None:
        """Discard the lines of an incomplete command."""

    def close(self) -> None:
        """End Tcl, and discard its variables."""
