"""A session: the bus, the nodes and the options that lines work with; everything opened when first needed.

Joins buses, simulator, files and device. Does not parse lines and does not print results.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from functools import cached_property
from typing import TYPE_CHECKING, Any

from dvtcli.device.change.cancellation import Cancellation
from dvtcli.device.restarts import losses, refuse_after_restarts
from dvtcli.errors import BusUnavailable, DvtcliError, SafetyRefusal, UsageError
from dvtcli.operations.options import START_ONLY, Options
from dvtcli.operations.settings import Settings, chooser

if TYPE_CHECKING:
    from pathlib import Path

    from dvtcli.cli.script_changes import ScriptChanges
    from dvtcli.cli.view.output import Output
    from dvtcli.device.nmt_gate import Gate
    from dvtcli.device.node import Node
    from dvtcli.domain.heard import LastFrames
    from dvtcli.domain.object_dictionary import ObjectDictionary
    from dvtcli.domain.ports import CanopenBus
    from dvtcli.operations.open_network import Network, Secrets
    from dvtcli.operations.serve import Serving, Wanted


#: Exit codes after which a device may be half configured, and must not go back to OPERATIONAL.
_HALF_CONFIGURED = frozenset({7, 70})

#: Who chose the bus where no option, variable or file did.
NOBODY = "nobody"


class Session:
    """What one run of dvtcli knows; commands ask it for the bus, the node and consent.

    *on_open* is called when the bus is about to be opened.
    """

    def __init__(self, output: Output, on_open: Callable[[], None] = lambda: None) -> None:
        self.output = output
        self.on_open = on_open
        self.base = self.options = Options()
        self.cancellation = Cancellation()
        #: at the prompt and in scripts the bus is chosen already
        self.started = False
        #: the scripts that run, the outermost first
        self.scripts: list[str] = []
        #: what the lines of the outermost script have changed
        self.script_changes: ScriptChanges | None = None
        #: `FILE:LINE` of the script line that runs
        self.place: str | None = None
        self.selected: int | None = None
        #: everything that was said at the program's start, and why it must not be used where it must not
        self.settings = Settings()
        self._unusable: DvtcliError | None = None
        self._warned = False
        #: where each option of the program's start was said: `option`, its variable or the settings file
        self.sources: dict[str, str] = {}
        #: script lines of everything that succeeded and changed something, with the node that each is about
        self.executed: list[tuple[int, str]] = []
        #: words of the prompt's user, each with what it stands for
        self.aliases: dict[str, str] = {}
        #: the last frames that were heard, where somebody listens all the time as the prompt does
        self.frames: LastFrames | None = None
        self._network: Network | None = None
        self._twin: Network | None = None
        #: whether this is another session's stage: what is noticed on the bus is told there
        self._on_twins = False
        self._untap: Callable[[], None] | None = None

    def read_settings(self, variables: dict[str, Any]) -> None:
        """Take the settings files that count here, and the options that *variables* of the environment give."""
        self.settings.read_files()
        self.settings.variables = {name: (value, f"DVTCLI_{name.upper()}") for name, value in variables.items()}

    def start(self, given: dict[str, Any], where: str = "option") -> None:
        """Take the options of the program's start, which were said in *where*."""
        self.settings.typed |= {name: (value, where) for name, value in given.items()}
        found, self._unusable = self.settings.resolved()
        self.base = self.options = Options()._replace(**{name: value for name, (value, _) in found.items()})
        self.sources = {name: said for name, (_, said) in found.items()}
        self._show()

    def require_settings(self) -> None:
        """Raise what is wrong with the settings; what a project's file says in vain is said once."""
        if self._unusable is not None:
            raise self._unusable
        said = None if self._warned else self.settings.never_taken()
        self._warned = True
        if said is not None:
            self.output.warning(said)

    def chosen_by(self) -> str:
        """Who chose the bus: an option, a variable or a file, for people."""
        found = chooser(self.sources)
        if found is not None:
            return found
        from dvtcli.operations.open_network import library_chooser

        return library_chooser()

    @contextmanager
    def line(self, given: dict[str, Any]) -> Iterator[None]:
        """Let one line's own options count while it runs, also for the lines of a script that it runs.

        Where the line fails its way of showing things stays until `settle`, since its error is yet to be shown.
        """
        refused = sorted(START_ONLY & given.keys()) if self.started else []
        if refused:
            raise UsageError(
                f"--{refused[0].replace('_', '-')} chooses the bus or the node's files: give it when dvtcli starts",
                hint="leave, and start again with it; `node ID` selects another node of the same bus",
            )
        if not self.started:
            self.start(given)
        outer = self.base
        fresh_twin = given.get("dry_run") and not outer.dry_run
        self.base = self.options = outer._replace(**given)
        self._show()
        self.cancellation.release()
        try:
            yield
        except DvtcliError as error:
            if self.dry_run:
                error.state = "unchanged"
                error.details.insert(0, ("dry run", "this was the node's twin; nothing was sent"))
            raise
        finally:
            self.cancellation.hold()  # a signal waits until the line's end is reached in order
            if fresh_twin:
                self._twin = None
            self.base = self.options = outer
        if self.in_script or not self.started:
            refuse_after_restarts(self._nodes())
        self.settle()

    def settle(self) -> None:
        """A line ended, well or not: say what was noticed meanwhile, and show things as before it."""
        self.warn_of_disturbances()
        for text in losses(self._nodes()):
            self.output.warning(f"{text}; see `verify`")
        self._show()

    def _show(self) -> None:
        options = self.options
        self.output.configure(options.format, options.color, options.verbose, quiet=options.quiet, plain=options.ascii)
        if self._network is not None:
            self._network.bus.set_timeout(options.timeout)
        self._watch()

    def _watch(self) -> None:
        """Show traffic while -v asks for it, and only then: a tap costs time on every frame."""
        if self._network is None or bool(self.options.verbose) == (self._untap is not None):
            return
        if self._untap is not None:
            self._untap()
            self._untap = None
        else:
            secret, traffic = self.secrets.in_frame, self.output.traffic
            self._untap = self._network.bus.tap(lambda frame, sent: traffic(frame, sent=sent, secret=secret(frame)))

    @property
    def in_script(self) -> bool:
        """Whether a script runs: it never asks, and keeps a node pre-operational until its last line."""
        return bool(self.scripts)

    @property
    def dry_run(self) -> bool:
        """Whether writes go to a twin."""
        return self.options.dry_run

    @property
    def network(self) -> Network:
        """The bus with its nodes, or their twins under --dry-run; opened on first use."""
        from dvtcli.operations.open_network import twin_of

        network = self.open_network()
        if not self.dry_run:
            return network
        if self._twin is None:
            self._twin = twin_of(network)
        return self._twin

    def open_network(self) -> Network:
        """The bus itself with its nodes, also under --dry-run; opened on first use."""
        from dvtcli.operations.open_network import Network

        if self._network is None:
            self.require_settings()
            self.on_open()
            self._network = self._opened(Network)
            self._watch()
        return self._network

    def _opened(self, network: type[Network]) -> Network:
        """Open the bus; who chose it is said under -v and where it does not open."""
        try:
            opened = network.opened(self.base, self.cancellation, self._consent, self.output.note, self.output.warning)
        except BusUnavailable as failed:
            if (by := self.chosen_by()) != NOBODY:
                failed.details.append(("chosen by", by))
            raise
        if self.options.verbose:
            self.output.note(f"{opened.bus.name} is open, chosen by {self.chosen_by()}")
        return opened

    def serving(self, wanted: Wanted) -> AbstractContextManager[Serving]:
        """Simulated nodes for other programs, instead of a bus of our own."""
        from dvtcli.operations.serve import serving

        self.require_settings()
        self.on_open()
        return serving(self.base, wanted, self.output.warning)

    def on_twins(self) -> Session:
        """A session of its own on fresh twins of the nodes as they are: it asks, shows, remembers and sends nothing."""
        import io
        from dataclasses import replace

        from dvtcli.cli.view.output import Output

        network = self.network
        stage = Session(Output(io.StringIO(), io.StringIO()))
        quiet = self.base._replace(dry_run=True, force=True, verbose=0, quiet=True, format="text")
        stage.base = stage.options = quiet
        stage._on_twins = True
        stage.cancellation, stage.selected, stage.started = self.cancellation, self.selected, True
        stage._network = replace(
            network, options=quiet, nodes={}, order=[], done_before=lambda _node_id: [], guarded=False,
            met=lambda: list(network.nodes), say=lambda _text: None, warn=lambda _text: None,
        )  # fmt: skip
        return stage

    @property
    def wire(self) -> CanopenBus:
        """The bus itself, also under --dry-run: to listen to, never to write to."""
        assert self._network is not None  # noqa: S101 - who listens has opened it
        return self._network.bus

    @property
    def state_folder(self) -> Path:
        """Where journals, locks and backups are kept."""
        from dvtcli.operations.open_network import state_folder

        return state_folder(self.options)

    @property
    def is_open(self) -> bool:
        """Whether the bus was opened."""
        return self._network is not None

    @property
    def bus(self) -> CanopenBus:
        """The bus, or the twin's under --dry-run."""
        return self.network.bus

    def node_id(self) -> int:
        """The selected node-ID: `node ID`, else -n, else the first simulated node; UsageError where none is."""
        return self.default_id() if self.selected is None else self.selected

    def default_id(self) -> int:
        """The node-ID that is selected before any `node ID`."""
        if self.base.node is not None:
            return self.base.node
        if self.base.sim:
            return self.network.simulated_ids[0]
        raise UsageError(
            "no node is selected",
            hint="scan finds the nodes; `node ID` selects one at the prompt and in scripts, -n ID on the command line",
        )

    def selected_id(self) -> int | None:
        """The selected node-ID, or None where none is."""
        try:
            return self.node_id()
        except UsageError:
            return None

    def node(self, node_id: int | None = None) -> Node:
        """The node with *node_id*, or the selected one."""
        return self.network.node(self.node_id() if node_id is None else node_id)

    def offline_dictionaries(self) -> list[tuple[ObjectDictionary, dict[str, str]]]:
        """Dictionaries (with aliases) known without touching a bus: --eds, and those of simulated nodes."""
        from dvtcli.operations.open_network import offline_dictionaries

        return offline_dictionaries(self.base)

    def completion_dictionaries(self, node_id: int | None = None) -> list[tuple[ObjectDictionary, dict[str, str]]]:
        """The dictionaries that completion may offer: the open node's (None: the selected one), else those offline."""
        if self._network is not None:
            node = self._network.nodes.get((self.selected_id() if node_id is None else node_id) or 0)
            if node is not None and node.dictionary is not None:
                return [(node.dictionary, node.profile.aliases)]
        return self.offline_dictionaries()

    def known_ids(self) -> list[int]:
        """Node-IDs that are known without asking any bus: those met, those simulated, and the selected one."""
        met = set(self._network.nodes) | set(self._network.simulated_ids) if self._network is not None else set()
        return sorted(met | {one for one in (self.selected, self.base.node) if one is not None})

    def record(self, node_id: int, lines: list[str]) -> None:
        """Remember script *lines* about a node that succeeded and changed something, for `save`."""
        self.executed += [(node_id, line) for line in lines]

    def unrecord(self, node_id: int, lines: list[str]) -> bool:
        """Forget *lines* where they are the last that are remembered about the node; whether they were."""
        own = [number for number, (about, _) in enumerate(self.executed) if about == node_id][-len(lines) :]
        if not lines or [self.executed[number][1] for number in own] != lines:
            return False
        for number in reversed(own):
            del self.executed[number]
        return True

    def consent(self, question: str) -> None:
        """Ask *question* where somebody can answer; returns on yes, raises SafetyRefusal otherwise."""
        self._consent(question)

    def _consent(self, question: str) -> None:
        if self.options.yes or self.dry_run:
            return
        if self.in_script or not (sys.stdin.isatty() and sys.stderr.isatty()):
            raise SafetyRefusal(f"nobody can answer: {question}", hint="give --yes to answer yes")
        with self.cancellation.released():  # Ctrl-C here is a no to everything that the question was for
            answer = self.output.ask(question)
        if not answer:
            raise SafetyRefusal("not done: the answer was no")

    def end_line(self, code: int, *, alone: bool = False) -> None:
        """A line of its own, or a whole script, ended with *code*: nodes go back to the NMT state they were found in.

        Not after a failure that left a device changed, nor after one in the middle of a script, which is neither the
        old set-up nor the new one: there they stay PRE-OPERATIONAL, and that is said. Another dvtcli may write then.
        Where the line stands *alone*, not at a prompt, Restarted is raised if a node lost by then what was set.
        """
        failures: list[DvtcliError] = []
        with self.cancellation.guard():  # a signal waits until the nodes are where they belong
            for node in self.met_nodes():
                from dvtcli.device.change.safekeeping import let_go

                try:
                    self._end_gate(node.gate, code)
                except DvtcliError as failed:  # the other nodes go back all the same
                    failures.append(failed)
                finally:
                    let_go(node.keeper)
        if failures:
            raise failures[0]
        if alone and not code:
            refuse_after_restarts(self._nodes())

    def _end_gate(self, gate: Gate, code: int) -> None:
        try:
            if code not in _HALF_CONFIGURED:
                gate.leave()
        finally:
            left_behind = gate.abandon()
            if left_behind:
                self.output.warning(left_behind)

    @cached_property
    def secrets(self) -> Secrets:
        """What no screen and no file may show: passcodes on the wire and in lines."""
        from dvtcli.operations.open_network import Secrets

        return Secrets.known()

    def is_secret(self, line: str) -> bool:
        """Whether a typed *line* may hold a passcode; asks no bus."""
        nodes = self._network.nodes.values() if self._network is not None else ()
        return self.secrets.in_line(line, [node.dictionary for node in nodes if node.dictionary is not None])

    def warn_of_disturbances(self) -> None:
        """Say what was noticed on the SDO channels: another client, two nodes with one node-ID."""
        for text in self._network.bus.disturbances() if self._network and not self._on_twins else ():
            self.output.warning(text)

    def _nodes(self) -> list[Node]:
        return list(self._network.nodes.values()) if self._network is not None else []

    def met_nodes(self) -> Iterator[Node]:
        """Every node that was looked at so far, and every twin of one."""
        for network in (self._network, self._twin):
            yield from network.nodes.values() if network else ()

    def staying(self) -> tuple[str, ...]:
        """`FILE:LINE` of the lines of the script that runs whose changes the nodes hold; none under --dry-run."""
        return () if self.script_changes is None or self.dry_run else self.script_changes.staying()

    def close(self) -> None:
        """Leave the bus."""
        self._twin = None
        if self._network is not None:
            self._network.close()
            self._network = self._untap = None
