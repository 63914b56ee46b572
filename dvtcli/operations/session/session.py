"""A session: the open bus, the selected node, and all changes so far; and the part of it that operations on nodes need.

Messages go to a `Reporter`. An operation that takes a part cannot open, close or reconfigure the session: mypy refuses
it.
"""

from __future__ import annotations

from contextlib import contextmanager
from functools import cached_property
from typing import TYPE_CHECKING, Protocol, TypeVar

from dvtcli.errors import DvtcliError, NoAnswer, UsageError
from dvtcli.operations.session.opened import Opened
from dvtcli.operations.user.session_user import SessionUser

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from dvtcli.device.nmt_gate import Gate
    from dvtcli.device.node import Node
    from dvtcli.device.target_config import TargetConfig
    from dvtcli.domain.ports import CanopenBus
    from dvtcli.operations.session.open_network import Network, OpenBus
    from dvtcli.operations.user.options import Options
    from dvtcli.operations.user.session_user import Reporter


class Rehearse(Protocol):
    """Evaluates a script on twins, starting with *node_id* selected."""

    def __call__(self, file: str, node_id: int | None = None) -> dict[int, TargetConfig]:
        """Return the configuration that the script *file* makes, by node-ID; errors of a line have FILE:LINE."""


class Record:
    """Script lines in order, each with its node-ID (0: all nodes)."""

    def __init__(self) -> None:
        self.lines: list[tuple[int, str]] = []

    def add(self, node_id: int, lines: list[str]) -> None:
        """Add script *lines* that changed a node."""
        self.lines += [(node_id, line) for line in lines]

    def remove_last(self, node_id: int, lines: list[str]) -> bool:
        """Remove *lines* if they are the node's last; returns whether they were."""
        own = [number for number, (about, _) in enumerate(self.lines) if about == node_id][-len(lines) :]
        if not lines or [self.lines[number][1] for number in own] != lines:
            return False
        for number in reversed(own):
            del self.lines[number]
        return True

    def of(self, node_id: int) -> list[str]:
        """Return the lines about a node."""
        return [line for about, line in self.lines if about == node_id]


T = TypeVar("T")
#: Exit codes after which a device may be half configured, and must not go back to OPERATIONAL.
_HALF_CONFIGURED = frozenset({7, 70})


class Session(Opened):
    """An open session; operations take from it the bus, nodes and consent.

    In Python: `with Session(Options(sim=("gen4",))) as session:` and any operation with the session as first argument.
    *options* are the initial options, and *reporter* gets messages for the user. *open_bus* opens another bus than
    that of the options.
    """

    def __init__(
        self, options: Options | None = None, reporter: Reporter | None = None, *, open_bus: OpenBus | None = None
    ) -> None:
        super().__init__(options, reporter, open_bus=open_bus)
        self.selected: int | None = None
        self._reads_together = False

    def __enter__(self) -> Session:
        return self

    def __exit__(self, raised: type[BaseException] | None, error: BaseException | None, _traceback: object) -> None:
        code = 0 if raised is None else error.exit_code if isinstance(error, DvtcliError) else 1
        try:
            self.end_line(code)
        finally:
            self.close()

    @cached_property
    def record(self) -> Record:
        """Return the successful changes as script lines."""
        return Record()

    @contextmanager
    def selecting(self, node_id: int | None) -> Iterator[None]:
        """Select *node_id*, or no node, inside a block; restores the old selection."""
        before, self.selected = self.selected, node_id
        try:
            yield
        finally:
            self.selected = before

    def node_id(self) -> int:
        """The selected node-ID: `node ID`, else -n, else the first simulated node; UsageError if there is none."""
        return self.default_id() if self.selected is None else self.selected

    def default_id(self) -> int:
        """Return the node-ID selected before any `node ID`."""
        if self.base.one_node is not None:
            return self.base.one_node
        from dvtcli.domain.hint import Action, Hint

        if self.base.nodes or self.base.every_node:
            said = ",".join(map(str, self.base.nodes)) or "all"
            raise UsageError(
                "several nodes are selected, but the command is for one node",
                given={"node_id": said},
                hint=Hint(
                    Action.GIVE,
                    {"node_id": "ID"},
                    "{} with one node-ID; commands that read, store, or take a file accept several",
                ),
            )
        if self.base.sim and (simulated := self.network.simulated_ids):
            return simulated[0]
        raise UsageError(
            "no node is selected",
            hint=Hint(Action.FIND_NODES, why="finds the nodes")
            + Hint(Action.SHOW_NODE, {"node": "ID"}, "selects one at the prompt and in scripts")
            + Hint(Action.GIVE, {"node_id": "ID"}, ", {} on the command line"),
        )

    def selected_id(self) -> int | None:
        """Return the selected node-ID, or None."""
        try:
            return self.node_id()
        except UsageError:
            return None

    def node(self, node_id: int | None = None) -> Node:
        """Return the node with *node_id*, or the selected node."""
        return self.network.node(self.node_id() if node_id is None else node_id)

    def known_ids(self) -> list[int]:
        """List node-IDs known without a scan: met, simulated and selected."""
        met = set(self._network.nodes) | set(self._network.simulated_ids) if self._network is not None else set()
        return sorted(met | {known_id for known_id in (self.selected, *self.base.nodes) if known_id is not None})

    def read_together(self, look: Callable[[], T]) -> T:
        """Read several nodes by *look*, repeated until no node restarted meanwhile.

        A node counts from its first contact. Raises NoAnswer after `MAX_READS` attempts. A nested call reads once, as
        the outer call repeats everything.
        """
        if self._reads_together:
            return look()
        self._reads_together = True
        try:
            return self._read_together(look)
        finally:
            self._reads_together = False

    def _read_together(self, look: Callable[[], T]) -> T:
        from dvtcli.device.observe import MAX_READS

        for left in reversed(range(MAX_READS)):
            boot_ups = {node_id: node.bus.boot_ups(node_id) for node_id, node in self.seen_nodes().items()}
            found = look()
            restarted = [
                node_id
                for node_id, node in sorted(self.seen_nodes().items())
                if node.bus.boot_ups(node_id) != boot_ups.get(node_id, node.boot_ups_at_contact)
            ]
            if not restarted:
                return found
            from dvtcli.domain.text import all_nodes

            names = all_nodes(restarted)
            if left:
                self.reporter.note(f"{names} restarted during the reading, which is repeated")
        raise NoAnswer(
            f"{names} restarted during each of {MAX_READS} readings",
            node=restarted[0],
            hint="check its supply and its wiring, then try again",
        )

    def end_line(self, code: int, *, alone: bool = False) -> None:
        """End a line or a whole script with *code*: restores the nodes' initial NMT states.

        After a failure that left a device changed, or in the middle of a script, nodes stay PRE-OPERATIONAL, with a
        message, as their set-up is mixed. Other dvtcli processes may write afterwards. *alone* (not at a prompt) raises
        Restarted if a node has lost its changes.
        """
        failures: list[DvtcliError] = []
        self.made.clear()
        if self._network is not None:
            self._network.asked_again.clear()
        with self.cancellation.deferred():  # a signal waits until the nodes are where they belong
            for node in self.met_nodes():
                try:
                    self._end_gate(node.gate, code)
                    if not code:
                        node.require_saved()
                except DvtcliError as failed:  # the other nodes go back all the same
                    failures.append(failed)
                finally:
                    if node.forget_restart(failed=bool(code)):
                        self.reporter.warning(f"node {node.node_id} restarted since it was read before")
                    node.saved_automatically.clear()
                    node.read_cache.clear()
                    node.release_lock()
        if failures:
            raise failures[0]
        if alone and not code and (nodes := self._nodes()):
            from dvtcli.device.node import refuse_after_restarts

            refuse_after_restarts(nodes)

    def _end_gate(self, gate: Gate, code: int) -> None:
        try:
            if code not in _HALF_CONFIGURED:
                gate.leave()
        finally:
            left_behind = gate.abandon()
            if left_behind:
                self.reporter.warning(left_behind)


class SessionNodes(SessionUser, Protocol):
    """The bus and the nodes of a session, as `Session` has them."""

    @property
    def is_open(self) -> bool:
        """Whether the bus was opened."""

    @property
    def wire(self) -> CanopenBus:
        """The bus itself, also under --dry-run: to listen to, never to write to."""

    @property
    def bus(self) -> CanopenBus:
        """The bus, or the twins' under --dry-run."""

    @property
    def network(self) -> Network:
        """The bus with its nodes, or their twins under --dry-run; opened at first use."""

    @property
    def selected(self) -> int | None:
        """The node-ID selected by `node ID`."""

    @property
    def record(self) -> Record:
        """The successful changes as script lines."""

    def open_network(self) -> Network:
        """See `Opened.open_network`."""

    def node(self, node_id: int | None = None) -> Node:
        """See `Session.node`."""

    def node_id(self) -> int:
        """See `Session.node_id`."""

    def selected_id(self) -> int | None:
        """See `Session.selected_id`."""

    def default_id(self) -> int:
        """See `Session.default_id`."""

    def known_ids(self) -> list[int]:
        """See `Session.known_ids`."""

    def seen_nodes(self) -> dict[int, Node]:
        """See `Opened.seen_nodes`."""

    def read_together(self, look: Callable[[], T]) -> T:
        """See `Session.read_together`."""
