"""A session: the bus, its nodes and the options that count; everything is opened when it is first needed.

Joins buses, simulator, files and device. Knows no lines, no scripts and no screen: what is to be said goes to a
`Teller`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from functools import cached_property
from typing import TYPE_CHECKING, Any

from dvtcli.device.change.cancellation import Cancellation
from dvtcli.device.restarts import refuse_after_restarts
from dvtcli.errors import DRY_RUN, BusUnavailable, DvtcliError, SafetyRefusal, UsageError
from dvtcli.operations.options import Options
from dvtcli.operations.record import Record
from dvtcli.operations.settings import NOBODY, Settings
from dvtcli.operations.telling import Silent, Teller

if TYPE_CHECKING:
    from pathlib import Path

    from dvtcli.device.change.whole import Whole
    from dvtcli.device.nmt_gate import Gate
    from dvtcli.device.node import Node
    from dvtcli.domain.heard import LastFrames
    from dvtcli.domain.ports import CanopenBus
    from dvtcli.operations.open_network import Network, OpenBus, Secrets
    from dvtcli.operations.serve import Serving, Wanted

#: Exit codes after which a device may be half configured, and must not go back to OPERATIONAL.
_HALF_CONFIGURED = frozenset({7, 70})


class Session:
    """What is open; operations ask it for the bus, for nodes and for consent.

    In Python: `with Session(Options(sim=("gen4",))) as session:` and then any operation, which takes the session first.
    *options* count from the beginning, and *tell* hears what the user should know. *open_bus* opens another bus than
    the one that the options name.
    """

    def __init__(
        self, options: Options | None = None, tell: Teller | None = None, *, open_bus: OpenBus | None = None
    ) -> None:
        self.tell: Teller = tell or Silent()
        self.base = self.options = options or Options()
        self.cancellation = Cancellation()
        #: called when the bus is about to be opened
        self.on_open: Callable[[], None] = lambda: None
        #: everything that was said at the program's start, in options, variables and files
        self.settings = Settings()
        self.selected: int | None = None
        #: what succeeded and changed something, as script lines
        self.record = Record()
        #: the last frames that were heard, where somebody listens all the time as the prompt does
        self.frames: LastFrames | None = None
        self._open_bus = open_bus
        self._network: Network | None = None
        self._twin: Network | None = None
        self._untap: Callable[[], None] | None = None

    def __enter__(self) -> Session:
        return self

    def __exit__(self, raised: type[BaseException] | None, error: BaseException | None, _traceback: object) -> None:
        code = 0 if raised is None else error.exit_code if isinstance(error, DvtcliError) else 1
        try:
            self.end_line(code)
        finally:
            self.close()

    @contextmanager
    def under(self, **given: Any) -> Iterator[None]:
        """Let other options, by their names in `Options`, count while the block runs, `dry_run=True` above all."""
        try:
            with self._under(given):
                yield
        finally:
            self._apply()

    @contextmanager
    def _under(self, given: Mapping[str, Any]) -> Iterator[None]:
        """Let *given* options count; what they do to the bus stays until the next `_apply`."""
        outer = self.base
        fresh_twin = given.get("dry_run") and not outer.dry_run
        self.base = self.options = outer._replace(**given)
        self._apply()
        try:
            yield
        except DvtcliError as error:
            if self.dry_run:
                error.state = "unchanged"
                error.details.insert(0, (DRY_RUN, "this was the node's twin; nothing was sent"))
            raise
        finally:
            if fresh_twin:
                self._twin = None
            self.base = self.options = outer

    def _apply(self) -> None:
        """Let the bus do as the options say now."""
        if self._network is not None:
            self._network.bus.set_timeout(self.options.timeout)
        self._watch()

    def _watch(self) -> None:
        """Show traffic while -v asks for it, and only then: a tap costs time on every frame."""
        if self._network is None or bool(self.options.verbose) == (self._untap is not None):
            return
        if self._untap is not None:
            self._untap()
            self._untap = None
        else:
            secret, traffic = self.secrets.in_frame, self.tell.traffic
            self._untap = self._network.bus.tap(lambda frame, sent: traffic(frame, sent=sent, secret=secret(frame)))

    def require_settings(self) -> None:
        """Raise what is wrong with the settings; what a project's file says in vain is said once."""
        said = self.settings.required()
        if said is not None:
            self.tell.warning(said)

    def chosen_by(self) -> str:
        """Who chose the bus: an option, a variable or a file, for people."""
        return self.settings.chosen_by()

    @property
    def in_script(self) -> bool:
        """Whether lines follow one another, with nobody to look at each answer."""
        return False

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
        tell = self.tell
        try:
            opened = network.opened(
                self.base,
                self.cancellation,
                self.consent,
                tell.note,
                tell.warning,
                doing=self.doing,
                open_bus=self._open_bus,
            )
        except BusUnavailable as failed:
            if (by := self.chosen_by()) != NOBODY:
                failed.details.append(("chosen by", by))
            elif described := self.settings.described_buses():
                failed.hint = f"{described}; {failed.hint}"
            failed.at_start = True
            raise
        except UsageError as wrong:
            wrong.at_start = True
            raise
        opened.whole = self.whole
        if self.options.verbose:
            tell.note(f"{opened.bus.name} is open, chosen by {self.chosen_by()}")
        return opened

    def doing(self) -> str:
        """What is being done, for another dvtcli that waits for a node: nothing that has a name."""
        return ""

    def serving(self, wanted: Wanted) -> AbstractContextManager[Serving]:
        """Simulated nodes for other programs, instead of a bus of our own."""
        from dvtcli.operations.serve import serving

        self.require_settings()
        self.on_open()
        return serving(self.base, wanted, self.tell.warning)

    @property
    def wire(self) -> CanopenBus:
        """The bus itself, also under --dry-run: to listen to, never to write to."""
        assert self._network is not None  # noqa: S101 - who listens has opened it
        return self._network.bus

    @property
    def bus(self) -> CanopenBus:
        """The bus, or the twin's under --dry-run."""
        return self.network.bus

    @property
    def is_open(self) -> bool:
        """Whether the bus was opened."""
        return self._network is not None

    @property
    def state_folder(self) -> Path:
        """Where journals, locks and backups are kept."""
        from dvtcli.operations.open_network import state_folder

        return state_folder(self.options)

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

    def known_ids(self) -> list[int]:
        """Node-IDs that are known without asking any bus: those met, those simulated, and the selected one."""
        met = set(self._network.nodes) | set(self._network.simulated_ids) if self._network is not None else set()
        return sorted(met | {one for one in (self.selected, self.base.node) if one is not None})

    def met_nodes(self) -> Iterator[Node]:
        """Every node that was looked at so far, and every twin of one."""
        for network in (self._network, self._twin):
            yield from network.nodes.values() if network else ()

    def _nodes(self) -> list[Node]:
        return list(self._network.nodes.values()) if self._network is not None else []

    def consent(self, question: str) -> None:
        """Ask *question* where somebody can answer; returns on yes, raises SafetyRefusal otherwise."""
        if self.options.yes or self.dry_run:
            return
        with self.cancellation.released():  # Ctrl-C here is a no to everything that the question was for
            answer = self.tell.ask(question)
        if answer is None:
            raise SafetyRefusal(f"nobody can answer: {question}", hint="give --yes to answer yes")
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
                self.tell.warning(left_behind)

    @cached_property
    def whole(self) -> Whole:
        """The changes that stand or fall together, as those of an atomic script."""
        from dvtcli.device.change.whole import Whole

        return Whole()

    @cached_property
    def secrets(self) -> Secrets:
        """What no screen and no file may show: passcodes on the wire and in lines."""
        from dvtcli.operations.open_network import Secrets

        return Secrets.known()

    def warn_of_disturbances(self) -> None:
        """Say what was noticed on the SDO channels: another client, two nodes with one node-ID."""
        for text in self._network.bus.disturbances() if self._network is not None else ():
            self.tell.warning(text)

    def close(self) -> None:
        """Leave the bus."""
        self._twin = None
        if self._network is not None:
            self._network.close()
            self._network = self._untap = None
