"""A bus for a program: opened, asked for nodes, scanned, rehearsed on, closed. Prints nothing and asks nobody."""

from __future__ import annotations

import math
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

from dvtcli.errors import UsageError
from dvtcli.operations.api.calls import Calls
from dvtcli.operations.api.canopen_access import TakingTurns
from dvtcli.operations.api.checks import flags, number, path, seconds, whole, word, words, wrong
from dvtcli.operations.api.network_calls import NetworkCalls
from dvtcli.operations.api.python_node import Node
from dvtcli.operations.opening.simulated_nodes import read_dictionary
from dvtcli.operations.session.session import Session

if TYPE_CHECKING:
    from canopen import RemoteNode

    from dvtcli.bus.canopen_node import CanopenNetwork
    from dvtcli.operations.api.python_lss import Lss
    from dvtcli.operations.results import Changed, FramesSent, NodeListing, Replayed, SyncCheck, Synced


class FrameCalls(NetworkCalls):
    """A bus as far as its single frames go; `Bus` has the rest."""

    def send(
        self,
        *frames: str,
        every_s: float | None = None,
        for_s: float | None = None,
        count: int | None = None,
        nodes: Sequence[int] = (),
        file: str | Path | None = None,
        yes: bool = False,
    ) -> FramesSent:
        """Send *frames* (`"185#1027"`, `"185#R"`) once, or each *every_s* seconds: *count* times, or for *for_s* s.

        Needs *yes*, or asks, where nodes act on one: NMT, SYNC, TIME, SDO, LSS, EMCY and heartbeats, and what a PDO
        carries of *nodes*, of those that are known or heard, or of the network *file*. False where not every frame is
        known to be sent: `outcome` says how many, and why. UsageError where one is no frame; SafetyRefusal without
        consent. A dry run sends none.
        """
        from dvtcli.operations.frames.send_frames import send_frames

        if not frames or not all(isinstance(frame, str) for frame in frames):
            raise wrong("frames", frames, "frames as text: '185#1027'")
        for name, value in (("every_s", every_s), ("for_s", for_s)):
            if value is not None:
                number(name, value, "a number of seconds, 0.001…1000000", low=0.001, high=1e6)
        if count is not None:
            whole("count", count, "a count", 1_000_000, low=1)
        if every_s is not None and for_s is None and count is None:
            raise UsageError("every_s alone has no end", hint="give count or for_s")
        if not isinstance(nodes, list | tuple):
            raise wrong("nodes", nodes, "a list or tuple of node-IDs")
        asked = [whole("nodes", node, "a node-ID", 127, low=1) for node in nodes]
        known = None if file is None else str(path("file", file))
        return self._calls.run(
            lambda: send_frames(self._session, frames, every_s, for_s, count, asked, known), changes=True, yes=yes
        )

    def replay(
        self,
        recording: str | Path,
        *,
        rate: float = 1.0,
        within_s: tuple[float, float] = (-math.inf, math.inf),
        only: Sequence[str] = (),
        without: Sequence[str] = (),
        channel: str | None = None,
        loops: int = 1,
        yes: bool = False,
    ) -> Replayed:
        """Send the frames of *recording* again, *rate* times as fast (0: as the load limit lets), *loops* times.

        Only those *within_s* (from and to, seconds behind its first frame), of *channel*, that one of *only* means and
        none of *without*: `"281"`, `"180-1FF"`, `"node=5"`, `"5:tpdo1"`, `"sdo"`. Consent is as of `send`. False where
        not every frame is known to be sent: `outcome` says how many, how late, and why. UsageError where nothing of it
        is meant; InputFileError where it is damaged; SafetyRefusal without consent.
        """
        from dvtcli.operations.frames.replay_recording import Choice, replay_recording

        number("rate", rate, "how many times as fast, 0…1000", high=1000)
        if not isinstance(within_s, tuple) or len(within_s) != 2:
            raise wrong("within_s", within_s, "two numbers of seconds: (0, 10)")
        ends = (-math.inf, math.inf)
        begin_s, end_s = (end if end in ends else number("within_s", end, "numbers of seconds") for end in within_s)
        whole("loops", loops, "a count", 1_000_000, low=1)
        if channel is not None:
            word("channel", channel, "the name of a channel in the recording, or 'all'")
        choice = Choice(rate, begin_s, end_s, words("only", only), words("without", without), channel, loops)
        source = path("recording", recording)
        return self._calls.run(lambda: replay_recording(self._session, source, choice), changes=True, yes=yes)


class Bus(FrameCalls):
    """An open CAN bus; a context manager that leaves it.

    Made by `connect` and `simulate`. One call at a time is at work on a bus: calls of several threads wait for their
    turn. Call-backs come in the thread that called, and must not call the bus.
    """

    def __init__(self, session: Session) -> None:
        super().__init__(session, Calls(session))
        self._nodes: dict[int, Node] = {}
        self._name = session.wire.name
        self._canopen: CanopenNetwork | None = None
        self._remote: dict[int, RemoteNode] = {}

    def __enter__(self) -> Bus:
        self._calls.refuse_closed()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<dvtcli bus {self.name}{', closed' if self._calls.closed else ''}>"

    @property
    def name(self) -> str:
        """How the bus is called, for example `socketcan:can0`."""
        return self._name

    @property
    def lss(self) -> Lss:
        """The LSS master (CiA 305): finds nodes without a node-ID, gives node-IDs, changes the bit rate."""
        from dvtcli.operations.api.python_lss import Lss

        return Lss(self._calls)

    @property
    def is_dry_run(self) -> bool:
        """Whether calls work on twins of the nodes at the moment."""
        return self._session.dry_run

    def node(self, node_id: int | None = None, *, eds: str | Path | None = None, profile: str | None = None) -> Node:
        """The node with *node_id* (1…127; None: the first simulated one), with its device's file and its device family.

        Nothing is sent yet. Without *eds* the file that `dvtcli eds add` keeps for the device's identity is taken, or
        none; without *profile* the family is found from the identity. UsageError where the file cannot be read, or the
        node has another one already; InputFileError where the file is wrong.
        """
        eds = None if eds is None else path("eds", eds)
        if profile is not None:
            word("profile", profile, "the name of a device family, as `dvtcli.profiles()` lists them")
        with self._calls.alone():
            chosen = self._node_id(node_id)
            network = self._session.open_network()
            if eds is not None:
                read_dictionary(eds)
                _choose(network.files.own_eds, chosen, eds, met=chosen in network.nodes)
            if profile is not None:
                from dvtcli.files.profile.library import load_profile

                load_profile(profile)
                _choose(network.files.own_profile, chosen, profile, met=chosen in network.nodes)
            return self._nodes.setdefault(chosen, Node(self._calls, chosen, self._canopen_node))

    def _canopen_node(self, node_id: int) -> RemoteNode:
        from dvtcli.bus.canopen_node import CanopenNetwork, remote_node

        with self._calls.alone():
            session = self._session
            self._refuse_in_dry_run()
            if self._canopen is None:
                self._canopen = CanopenNetwork(session.wire, self._refuse_in_dry_run)
            if node_id not in self._remote:
                dictionary, channel = session.node(node_id).dictionary, TakingTurns(self._calls, node_id)
                self._remote[node_id] = remote_node(self._canopen, node_id, dictionary, channel)
            return self._remote[node_id]

    def _refuse_in_dry_run(self) -> None:
        if self._session.dry_run:
            raise UsageError("canopen speaks to the device itself: not in a dry run")

    def _node_id(self, node_id: int | None) -> int:
        simulated = self._session.open_network().simulated_ids
        if node_id is None and simulated:
            return simulated[0]
        if isinstance(node_id, bool) or not isinstance(node_id, int) or not 1 <= node_id <= 127:
            raise UsageError(f"{node_id!r} is not a node-ID; node-IDs are 1…127")
        return node_id

    def scan(self, answer_s: float = 0.05) -> NodeListing:
        """List the nodes 1…127 that are heard or answer within *answer_s* seconds each; a list of rows."""
        from dvtcli.operations.nodes.find_nodes import find_nodes

        seconds("answer_s", answer_s)
        return self._calls.run(lambda: find_nodes(self._session, answer_s))

    def sync(self, count: int = 1, *, period_ms: float = 20.0, node_id: int | None = None) -> Synced:
        """Send *count* SYNC messages (1…100000), one each *period_ms* (0.1…1000), and list what synchronous PDOs send.

        The CAN-ID is what 0x1005 of the node *node_id* says (None: of the first simulated node); 0x080 where there is
        none, or no answer. Frames are listed by CAN-ID: the last one of each, how many came, and whose TPDO it is where
        its node was read. BusUnavailable where the bus fails.
        """
        from dvtcli.operations.sync.produce_sync import produce_sync

        whole("count", count, "a count", 100_000, low=1)
        number("period_ms", period_ms, "a number of milliseconds, 0.1…1000", low=0.1, high=1000)
        if node_id is not None:
            whole("node_id", node_id, "a node-ID", 127, low=1)
        return self._calls.run(lambda: produce_sync(self._session, count, period_ms / 1000, node_id))

    def check_sync(self, *node_ids: int) -> SyncCheck:
        """Whether anybody produces SYNC, as `sync --check`: true where a SYNC is heard, or a node says it sends them.

        Asked are the nodes *node_ids*, those that were used so far, and the simulated ones: 0x1005 and 0x1006. The bus
        is listened to for two periods, at least 0.1 s; none is sent.
        """
        from dvtcli.operations.sync.unknown_sync import check_sync

        for node_id in node_ids:
            whole("node_ids", node_id, "a node-ID", 127, low=1)
        return self._calls.run(lambda: check_sync(self._session, node_ids))

    def recover(self, *, yes: bool = False, force: bool = False) -> tuple[Changed, ...]:
        """Put back what every interrupted change of the bus replaced, on all nodes, as `recover` without `-n`.

        Needs *yes*, or asks. None of it where no change was interrupted; each is false where its node does not take
        back what it held. LeftChanged where a node could not be put back.
        """
        from dvtcli.operations.recover.recover_change import recover
        from dvtcli.operations.results import Changed, ChangedNodes

        def work() -> tuple[Changed, ...]:
            with self._session.selecting(None):
                done = recover(self._session)
            return done.nodes if isinstance(done, ChangedNodes) else (done,) if isinstance(done, Changed) else ()

        return self._calls.run(work, changes=True, yes=yes, force=force)

    def finish_stores(self, *, yes: bool = False) -> tuple[int, ...]:
        """Go on with an `apply` that ended while its nodes stored, as `recover --finish`; who stored, by node-ID.

        Needs *yes*, or asks. Every node is verified once more before that; SafetyRefusal, and nothing is stored, where
        one holds something else by now. None where no change was interrupted; UsageError where not all nodes had been
        verified. LeftChanged where a node did not store.
        """
        from dvtcli.operations.recover.recover_change import recover
        from dvtcli.operations.results import Facts

        def work() -> tuple[int, ...]:
            with self._session.selecting(None):
                done = recover(self._session, finish=True)
            return tuple(dict(done.rows).get("stored", ())) if isinstance(done, Facts) else ()

        return self._calls.run(work, changes=True, yes=yes)

    def script(self, *, history: bool = False) -> str:
        """What this program's changes come to, as the text of a script that `dvtcli run` takes.

        With *history* it is every step as it was taken, stores and NMT commands included. Lines that require a node's
        identity stand before those about it. UsageError where nothing was changed.
        """
        from dvtcli.operations.session.save_script import ENDS, STEPS, script_text

        flags(history=history)
        return self._calls.run(lambda: script_text(self._session, STEPS if history else ENDS))

    @contextmanager
    def dry_run(self) -> Iterator[Bus]:
        """A block in which everything is done to exact twins of the nodes: nothing is written to the bus.

        The twins answer as the devices would, and forget everything at the block's end. Calls of other threads raise
        UsageError meanwhile: what they ask for may be meant for the devices.
        """
        calls, twins = self._calls, self._session.under(dry_run=True)
        begun = False
        try:
            with calls.alone():
                if calls.rehearsing is not None:
                    raise UsageError("a dry run is going on already")
                begun, calls.rehearsing = True, threading.get_ident()
                twins.__enter__()
            yield self
        finally:
            if begun:  # without a wait for other threads, and on a closed bus, too: a twin must never be left in force
                try:
                    twins.__exit__(None, None, None)
                finally:
                    calls.rehearsing = None

    def close(self) -> None:
        """Leave the bus, and let others write to its nodes; waits for a call that is at work. May be called twice."""
        network, self._canopen = self._canopen, None
        try:
            if network is not None:
                network.disconnect()
        finally:
            self._calls.close()


def _choose(chosen: dict[int, Any], node_id: int, what: Any, *, met: bool) -> None:
    """Let *what* be that of *node_id*; UsageError where that is another one already, chosen or *met*."""
    before = chosen.get(node_id)
    if met and before != what:
        raise UsageError(f"node {node_id} was used already: give eds and profile where it is first asked for")
    if before not in (None, what):
        raise UsageError(f"node {node_id} has another one already: {before}, not {what}")
    chosen[node_id] = what
