"""A conversation: a session with a screen, in which lines, scripts and their options follow one another.

It is what click hands to every command. Does not parse lines (`run_line`) and does not know what they do.
"""

from __future__ import annotations

import io
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import click

from dvtcli.errors import DvtcliError, State, UsageError
from dvtcli.operations.session.session import Session
from dvtcli.operations.user.options import START_ONLY, Options

if TYPE_CHECKING:
    from dvtcli.cli.scripts.script_changes import ScriptChanges
    from dvtcli.cli.scripts.script_report import ScriptReport
    from dvtcli.cli.typed_tcl import TypedTcl
    from dvtcli.cli.view.output import Output
    from dvtcli.cli.view.typed_hints import TypedCall
    from dvtcli.domain.hint import Hint
    from dvtcli.domain.object_dictionary import ObjectDictionary
    from dvtcli.domain.ports import Frame
    from dvtcli.domain.profile import DeviceProfile
    from dvtcli.operations.opening.bus_of_options import OpenBus
    from dvtcli.operations.results.bus_events import BusEvent


#: The options that a command behind this one needs to meet the same nodes, with their letters.
_REPEATED = {
    "interface": "-i", "channel": "-c", "bitrate": "-b", "bus_kwargs": "--bus-kwargs", "bus": "--bus", "sim": "--sim",
    "eds": "--eds", "profile": "-p", "journal": "--journal",
}  # fmt: skip


def typed_name(name: str) -> str:
    """The option *name* as it is typed."""
    return f"--{name.replace('_', '-')}"


def _repeated(given: dict[str, Any]) -> Iterator[str]:
    """Those of the options *given* that chose the bus and the node's files, as they are typed."""
    for name, option in _REPEATED.items():
        value = given.get(name, ())
        for word in value if isinstance(value, tuple) else (value,):
            yield option
            yield str(word)


class CliReporter:
    """A `Reporter` that shows on *output*, and asks where *may_ask*() and somebody sits at a terminal."""

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
        """Show that the bus is gone, or back: a document with --json, else a line on stderr that nobody may miss."""
        if self._output.json:
            self._output.documents([event.document()])
        else:
            self._output.lines([event.text])

    def instruct(self, text: str) -> None:
        """Show *text* as it is, also with --quiet and --json."""
        self._output.lines([text])

    def ask(self, question: str) -> bool | None:
        """Ask at the terminal; None in a script, and where there is no terminal."""
        if not self._may_ask() or not (sys.stdin.isatty() and sys.stderr.isatty()):
            return None
        return self._output.ask(question)

    def progress(self, text: str, done: int, total: int) -> None:
        """Show how far long work has come."""
        self._output.progress(text, done, total)

    def traffic(self, frame: Frame, *, sent: bool, secret: slice | None) -> None:
        """Show a frame."""
        self._output.traffic(frame, sent=sent, secret=secret)


class Conversation(Session):
    """What one run of dvtcli knows; *on_open* is called when the bus is about to be opened.

    *open_bus* is as in `Session`.
    """

    def __init__(
        self, output: Output, on_open: Callable[[], None] = lambda: None, *, open_bus: OpenBus | None = None
    ) -> None:
        super().__init__(tell=CliReporter(output, lambda: not self.in_script), open_bus=open_bus)
        self.output = output
        output.call = self.typed_call
        self.on_open = on_open
        #: at the prompt and in scripts the bus is chosen already
        self.started = False
        #: whether a line was `exit`
        self.left = False
        #: whether a `require` did not find the device that it wants
        self.other_device = False
        #: the scripts that run, the outermost first
        self.scripts: list[str] = []
        #: what the lines of the outermost script have changed
        self.script_changes: ScriptChanges | None = None
        #: what the lines of a script come to, where a report of them is asked for
        self.report: ScriptReport | None = None
        #: `FILE:LINE` of the script line that runs
        self.place: str | None = None
        #: whether what the line that runs does to nodes is noted there: it reads, or writes what they hold
        self.is_noted = True
        #: whether the user of the line that runs wants to know what nodes hold where it is stopped
        self.tells_state = False
        #: whether the line that runs writes nothing to nodes anyway
        self.only_looks = False
        #: whether an answer of the line that runs leaves it open that a node was changed
        self.may_have_changed = False
        #: what was written to nodes before the line that runs
        self._written_before: dict[int, int] = {}
        #: whether lines are typed at the prompt, where one follows the other
        self.at_prompt = False
        #: the Tcl of its lines, None until there was one
        self.tcl: TypedTcl | None = None
        #: words of the prompt's user, each with what it stands for
        self.aliases: dict[str, str] = {}
        #: whether this is a stage for another one's lines: what is noticed on the bus is told there
        self._is_stage = False

    def read_settings(self, variables: dict[str, Any]) -> None:
        """Take the settings files that count here, and the options that *variables* of the environment give."""
        self.settings.read_files()
        self.settings.variables = {name: (value, f"DVTCLI_{name.upper()}") for name, value in variables.items()}

    def require_settings(self) -> None:
        """As in `SessionOptions`, with the line that does what is to be done."""
        for said in self.settings.required():
            self.output.warning(said)

    def start(self, given: dict[str, Any], where: str = "") -> None:
        """Take the options of the program's start, which were typed, or said in *where*."""
        found = self.settings.start({name: (value, where or typed_name(name)) for name, value in given.items()})
        self.base = self.options = Options()._replace(**found)
        self._apply()

    def begin_line(self, *, is_noted: bool, tells_state: bool) -> None:
        """A line of a command begins; a script's are one with it."""
        self.acts()  # what was sent before is not this line's
        if self.in_script:
            self.is_noted &= is_noted
            return
        self.is_noted, self.tells_state, self._written_before = is_noted, tells_state, self.writes()

    def state_now(self) -> tuple[State, str | None]:
        """What is known of what nodes hold where the line that runs ends without its answer; in words, too."""
        written = {node for node, count in self.writes().items() if count != self._written_before.get(node, 0)}
        if self.is_noted and not written:
            return "unchanged", None
        if (
            self.is_noted
            and self.ends_with_line
            and all(node.history for node in self._nodes() if node.node_id in written)
        ):
            return "unknown", "written as planned, and read back equal before that"
        return "unknown", None

    @property
    def in_script(self) -> bool:
        """Whether a script runs: it never asks, and keeps a node pre-operational until its last line."""
        return bool(self.scripts)

    @property
    def ends_with_line(self) -> bool:
        """Whether nothing follows the command that runs: it is the program's only one."""
        return not self.started and not self.in_script

    @contextmanager
    def line(self, given: dict[str, Any]) -> Iterator[None]:
        """Let one line's own options count while it runs, also for the lines of a script that it runs.

        Where the line fails its way of showing things stays until `settle`, since its error is yet to be shown.
        """
        refused = sorted(START_ONLY & given.keys()) if self.started else []
        if refused:
            raise UsageError(
                f"{typed_name(refused[0])} chooses the bus or the node's files: give it when dvtcli starts",
                hint="leave, and start again with it; `node ID` selects another node of the same bus",
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
            from dvtcli.device.restarts import refuse_after_restarts

            refuse_after_restarts(nodes)
        self.settle()

    def typed_call(self) -> TypedCall:
        """The options of this call that a command behind it needs, too."""
        from dvtcli.cli.view.typed_hints import TypedCall

        given = {name: value for name, (value, where) in self.settings.typed.items() if where == typed_name(name)}
        nodes = given.get("node")
        word = ",".join(map(str, nodes)) if isinstance(nodes, tuple) else str(nodes)
        return TypedCall(
            tuple(_repeated(given)),
            () if nodes is None else ("-n", word),
            self.selected_id(),
            alone=not self.at_prompt,
            script=next((file for file in self.scripts[:1] if file.lower().endswith(".dvt")), ""),
        )

    def doing(self) -> str:
        """The command that runs, without what was typed behind it: that may be a passcode."""
        line = click.get_current_context(silent=True)
        return "" if line is None else line.info_name or ""

    def settle(self) -> None:
        """A line ended, well or not: say what was noticed meanwhile, and show things as before it."""
        if not self._is_stage:
            self.warn_of_disturbances()
        if nodes := self._nodes():
            from dvtcli.device.restarts import losses
            from dvtcli.domain.hint import Action, Hint, verbatim

            for node in nodes:
                for text in losses([node]):
                    why = f"{verbatim(text)}; see {{}}"
                    self.output.warning(Hint(Action.VERIFY, {"node": node.node_id}, why))
        self._apply()

    def _apply(self) -> None:
        """Let screen and bus do as the options say now."""
        options = self.options
        self.output.configure(options.format, options.color, options.verbose, quiet=options.quiet, plain=options.ascii)
        super()._apply()

    def on_twins(self) -> Conversation:
        """One of its own on fresh twins of the nodes as they are: it asks, shows, remembers and sends nothing."""
        from dataclasses import replace

        from dvtcli.cli.view.output import Output

        network = self.network
        stage = Conversation(Output(io.StringIO(), io.StringIO()))
        stage._is_stage = stage.started = True
        quiet = self.base._replace(dry_run=True, force=True, verbose=0, quiet=True, format="text")
        stage.base = stage.options = quiet
        stage.cancellation, stage.selected = self.cancellation, self.selected
        stage._network = replace(
            network, keeping=None, nodes={}, order=[], comes_back=False, left={}, done_before=lambda _node_id: [],
            met=lambda: list(network.nodes),
        )  # fmt: skip
        return stage

    def offline_dictionaries(self) -> list[tuple[ObjectDictionary, DeviceProfile]]:
        """Dictionaries (with their profiles) known without touching a bus: --eds, and those of simulated nodes."""
        from dvtcli.operations.opening.device_files import offline_dictionaries

        return offline_dictionaries(self.base)

    def completion_dictionaries(self, node_id: int | None = None) -> list[tuple[ObjectDictionary, DeviceProfile]]:
        """The dictionaries that completion may offer: the open node's (None: the selected one), else those offline."""
        if self._network is not None:
            node = self._network.nodes.get((self.selected_id() if node_id is None else node_id) or 0)
            if node is not None and node.dictionary is not None:
                return [(node.dictionary, node.profile)]
        return self.offline_dictionaries()

    def is_secret(self, line: str) -> bool:
        """Whether a typed *line* may hold a passcode; asks no bus."""
        return self.secrets.in_line(line, [node.dictionary for node in self._nodes() if node.dictionary is not None])

    def staying(self) -> tuple[str, ...]:
        """`FILE:LINE` of the lines of the script that runs whose changes the nodes hold; none under --dry-run."""
        return () if self.script_changes is None or self.dry_run else self.script_changes.staying()

    def stays_differing(self) -> tuple[str, ...] | None:
        """How nodes differ from what those lines set, read now; None where nothing is read, or a node cannot be."""
        if self.script_changes is None or self.dry_run or self.cancellation.requested:
            return None
        try:
            return self.script_changes.differing()
        except DvtcliError:  # what failed is told; of this nothing is claimed
            return None
