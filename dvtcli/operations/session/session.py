"""A session: the bus that is open, which of its nodes is meant, and what was done to them so far.

Knows no lines, no scripts and no screen: what is to be said goes to a `Reporter`.
"""

from __future__ import annotations

from contextlib import contextmanager
from functools import cached_property
from typing import TYPE_CHECKING, Protocol, TypeVar

from dvtcli.errors import DvtcliError, UsageError
from dvtcli.operations.opening.opened import Opened

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from dvtcli.device.nmt_gate import Gate
    from dvtcli.device.node import Node
    from dvtcli.device.wish import Wish
    from dvtcli.operations.opening.bus_of_options import OpenBus
    from dvtcli.operations.user.options import Options
    from dvtcli.operations.user.reporter import Reporter


class Rehearse(Protocol):
    """Finds what a script wishes of each node, by running it on twins; *node_id* is selected when it begins."""

    def __call__(self, file: str, node_id: int | None = None) -> dict[int, Wish]:
        """The wishes of the script *file*, by node-ID; a line that cannot run raises, with FILE:LINE."""


class Record:
    """Script lines in the order they were done, each with the node-ID that it is about (0: all nodes)."""

    def __init__(self) -> None:
        self.lines: list[tuple[int, str]] = []

    def add(self, node_id: int, lines: list[str]) -> None:
        """Remember script *lines* about a node that succeeded and changed something."""
        self.lines += [(node_id, line) for line in lines]

    def take_back(self, node_id: int, lines: list[str]) -> bool:
        """Forget *lines* where they are the last that are remembered about the node; whether they were."""
        own = [number for number, (about, _) in enumerate(self.lines) if about == node_id][-len(lines) :]
        if not lines or [self.lines[number][1] for number in own] != lines:
            return False
        for number in reversed(own):
            del self.lines[number]
        return True

    def of(self, node_id: int) -> list[str]:
        """The lines about one node."""
        return [line for about, line in self.lines if about == node_id]


T = TypeVar("T")
#: Exit codes after which a device may be half configured, and must not go back to OPERATIONAL.
_HALF_CONFIGURED = frozenset({7, 70})


class Session(Opened):
    """What is open; operations ask it for the bus, for nodes and for consent.

    In Python: `with Session(Options(sim=("gen4",))) as session:` and then any operation, which takes the session first.
    *options* count from the beginning, and *tell* hears what the user should know. *open_bus* opens another bus than
    the one that the options name.
    """

    def __init__(
        self, options: Options | None = None, tell: Reporter | None = None, *, open_bus: OpenBus | None = None
    ) -> None:
        super().__init__(options, tell, open_bus=open_bus)
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
        """What succeeded and changed something, as script lines."""

        return Record()

    @contextmanager
    def selecting(self, node_id: int | None) -> Iterator[None]:
        """A block in which *node_id* is selected, or none; the one from before is selected again behind it."""
        before, self.selected = self.selected, node_id
        try:
            yield
        finally:
            self.selected = before

    def node_id(self) -> int:
        """The selected node-ID: `node ID`, else -n, else the first simulated node; UsageError where none is."""
        return self.default_id() if self.selected is None else self.selected

    def default_id(self) -> int:
        """The node-ID that is selected before any `node ID`."""
        if self.base.one_node is not None:
            return self.base.one_node
        from dvtcli.domain.hint import Action, Hint

        if self.base.nodes or self.base.every_node:
            said = ",".join(map(str, self.base.nodes)) or "all"
            raise UsageError(
                "several nodes, and this is about one",
                given={"node_id": said},
                hint=Hint(
                    Action.GIVE,
                    {"node_id": "ID"},
                    "{} with one node-ID; what looks at nodes, stores, or takes a file goes with several",
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
        return sorted(met | {known_id for known_id in (self.selected, *self.base.nodes) if known_id is not None})

    def read_together(self, look: Callable[[], T]) -> T:
        """Read several nodes by *look*, and again until no node restarted from the first to the last upload.

        A node that *look* meets counts from its first contact on. NoAnswer if that fails `MOST_LOOKS` times. Within
        another call it is read once: that one reads all of it again.
        """
        if self._reads_together:
            return look()
        self._reads_together = True
        try:
            return self._read_together(look)
        finally:
            self._reads_together = False

    def _read_together(self, look: Callable[[], T]) -> T:
        from dvtcli.device.observe import MOST_LOOKS
        from dvtcli.errors import NoAnswer

        for left in reversed(range(MOST_LOOKS)):
            boot_ups = {node_id: node.bus.boot_ups(node_id) for node_id, node in self.seen_nodes().items()}
            found = look()
            restarted = [
                node_id
                for node_id, node in sorted(self.seen_nodes().items())
                if node.bus.boot_ups(node_id) != boot_ups.get(node_id, node.boot_ups_at_contact)
            ]
            if not restarted:
                return found
            names = f"node {', '.join(map(str, restarted))}"
            if left:
                self.tell.note(f"{names} restarted while it was read: it is read again")
        raise NoAnswer(
            f"{names} restarted each of {MOST_LOOKS} times that it was read",
            node=restarted[0],
            hint="look at its supply and its wiring, then try again",
        )

    def end_line(self, code: int, *, alone: bool = False) -> None:
        """A line of its own, or a whole script, ended with *code*: nodes go back to the NMT state they were found in.

        Not after a failure that left a device changed, nor after one in the middle of a script, which is neither the
        old set-up nor the new one: there they stay PRE-OPERATIONAL, and that is said. Another dvtcli may write then.
        Where the line stands *alone*, not at a prompt, Restarted is raised if a node lost by then what was set.
        """
        failures: list[DvtcliError] = []
        self.made.clear()
        if self._network is not None:
            self._network.asked_again.clear()
        with self.cancellation.guard():  # a signal waits until the nodes are where they belong
            for node in self.met_nodes():
                try:
                    self._end_gate(node.gate, code)
                    if not code:
                        node.require_kept()
                except DvtcliError as failed:  # the other nodes go back all the same
                    failures.append(failed)
                finally:
                    if node.end_of_line(failed=bool(code)):
                        self.tell.warning(f"node {node.node_id} restarted since it was read before")
                    node.kept_by_itself.clear()
                    node.memory.clear()
                    node.let_go()
        if failures:
            raise failures[0]
        if alone and not code and (nodes := self._nodes()):
            from dvtcli.device.restarts import refuse_after_restarts

            refuse_after_restarts(nodes)

    def _end_gate(self, gate: Gate, code: int) -> None:
        try:
            if code not in _HALF_CONFIGURED:
                gate.leave()
        finally:
            left_behind = gate.abandon()
            if left_behind:
                self.tell.warning(left_behind)
