"""A bus for a program: opened, asked for nodes, scanned, rehearsed on, closed. Prints nothing and asks nobody."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, TypedDict, Unpack

from dvtcli.bus.turns import in_callers_thread
from dvtcli.errors import UsageError
from dvtcli.operations.api.called_hints import errors_in_calls
from dvtcli.operations.api.calls import LOG, Calls, Message, Told
from dvtcli.operations.api.canopen_access import TakingTurns
from dvtcli.operations.api.checks import (
    call_back,
    flags,
    module_numbers,
    number,
    path,
    seconds,
    whole,
    word,
    words,
    wrong,
)
from dvtcli.operations.api.network_calls import NetworkCalls
from dvtcli.operations.api.python_node import Node
from dvtcli.operations.session.serve import LOOPBACK, ServeRequest, serving
from dvtcli.operations.session.session import Session
from dvtcli.operations.session.simulated_nodes import read_dictionary
from dvtcli.operations.user.options import BIT_RATES, options_of

if TYPE_CHECKING:
    from canopen import RemoteNode

    from dvtcli.bus.canopen_node import CanopenNetwork
    from dvtcli.device.change.applied import Progress
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

        Needs *yes*, or asks, if nodes act on a frame: NMT, SYNC, TIME, SDO, LSS, EMCY and heartbeats, and PDOs of
        *nodes*, of known nodes, or of the network *file*. False unless every frame is known to be sent: `outcome` has
        number and reason. Raises UsageError for an invalid frame; SafetyRefusal without consent. A dry run sends
        nothing.
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
        """Replay the frames of *recording*, *rate* times as fast (0: by the load limit), *loops* times.

        Only frames *within_s* (from and to, seconds after the first frame), of *channel*, matching any of *only* and
        none of *without*: `"281"`, `"180-1FF"`, `"node=5"`, `"5:tpdo1"`, `"sdo"`. Consent is as for `send`. False
        unless every frame is known to be sent: `outcome` has number, delay and reason. Raises UsageError if no frame is
        chosen; InputFileError if the file is damaged; SafetyRefusal without consent.
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
    """An open CAN bus; a context manager that closes it.

    Made by `connect` and `simulate`. A bus runs a single call at a time: calls of several threads wait for their turn.
    Call-backs run in the calling thread, and must not call the bus.
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
        """Tell whether calls now work on twins of the nodes."""
        return self._session.dry_run

    def node(
        self,
        node_id: int | None = None,
        *,
        eds: str | Path | None = None,
        profile: str | None = None,
        modules: Sequence[int] | None = None,
    ) -> Node:
        """Return the node with *node_id* (1…127; None: the first simulated node), with its EDS and device family.

        Sends nothing yet. Without *eds* the file of `dvtcli eds add` for the device's identity is taken, or none;
        without *profile* the family is found by the identity, without *modules* (numbers of the EDS of a modular
        device) they are read from the device (0x1027). Raises UsageError if the file cannot be read, or the node has
        another already; InputFileError if the file is invalid.
        """
        numbers = None if modules is None else module_numbers(modules)
        eds = None if eds is None else path("eds", eds)
        if profile is not None:
            word("profile", profile, "the name of a device family, as `dvtcli.profiles()` lists them")
        with self._calls.alone():
            chosen = self._node_id(node_id)
            network = self._session.open_network()
            if eds is not None:
                read_dictionary(eds, numbers)
                _choose(network.files.own_eds, chosen, eds, met=chosen in network.nodes)
            if profile is not None:
                from dvtcli.files.profiles import load_profile

                load_profile(profile)
                _choose(network.files.own_profile, chosen, profile, met=chosen in network.nodes)
            if numbers is not None:
                _choose(network.files.own_modules, chosen, numbers, met=chosen in network.nodes)
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
        """Send *count* SYNC messages (1…100000), *period_ms* (0.1…1000) apart, and list synchronous PDOs received.

        The CAN-ID is by 0x1005 of the node *node_id* (None: of the first simulated node); 0x080 if absent or without an
        answer. Frames are listed by CAN-ID: the last frame, their number, and the TPDO if its node was read. Raises
        BusUnavailable if the bus fails.
        """
        from dvtcli.operations.pdos.produce_sync import produce_sync

        whole("count", count, "a count", 100_000, low=1)
        number("period_ms", period_ms, "a number of milliseconds, 0.1…1000", low=0.1, high=1000)
        if node_id is not None:
            whole("node_id", node_id, "a node-ID", 127, low=1)
        return self._calls.run(lambda: produce_sync(self._session, count, period_ms / 1000, node_id))

    def check_sync(self, *node_ids: int) -> SyncCheck:
        """Tell whether anybody produces SYNC, as `sync --check`: true if received, or if a node is a producer.

        Reads 0x1005 and 0x1006 of *node_ids*, nodes used so far, and simulated nodes. Records the bus for two periods,
        at least 0.1 s; sends none.
        """
        from dvtcli.operations.pdos.sync import check_sync

        for node_id in node_ids:
            whole("node_ids", node_id, "a node-ID", 127, low=1)
        return self._calls.run(lambda: check_sync(self._session, node_ids))

    def recover(self, *, yes: bool = False, force: bool = False) -> tuple[Changed, ...]:
        """Roll back every interrupted change of the bus, on all nodes, as `recover` without `-n`.

        Needs *yes*, or asks. Empty if no change was interrupted; a result is false if its node does not take its old
        values. Raises LeftChanged if a roll-back failed.
        """
        from dvtcli.operations.changes.recover_change import recover
        from dvtcli.operations.results import Changed, ChangedNodes

        def work() -> tuple[Changed, ...]:
            with self._session.selecting(None):
                done = recover(self._session)
            return done.nodes if isinstance(done, ChangedNodes) else (done,) if isinstance(done, Changed) else ()

        return self._calls.run(work, changes=True, yes=yes, force=force)

    def finish_stores(self, *, yes: bool = False) -> tuple[int, ...]:
        """Complete an `apply` interrupted during stores, as `recover --finish`; returns the stored node-IDs.

        Needs *yes*, or asks. Every node is verified again before; raises SafetyRefusal, without a store, if a value
        differs. Empty if no change was interrupted; raises UsageError if not all nodes had been verified, LeftChanged
        if a node did not store.
        """
        from dvtcli.operations.changes.recover_change import recover
        from dvtcli.operations.results import Facts

        def work() -> tuple[int, ...]:
            with self._session.selecting(None):
                done = recover(self._session, finish=True)
            return tuple(dict(done.rows).get("stored", ())) if isinstance(done, Facts) else ()

        return self._calls.run(work, changes=True, yes=yes)

    def script(self, *, history: bool = False) -> str:
        """Return this program's net changes as a script for `dvtcli run`.

        *history*: every step, including stores and NMT commands. Lines that require a node's identity come before those
        about the node. Raises UsageError if there are no changes.
        """
        from dvtcli.operations.session.save_script import ENDS, STEPS, script_text

        flags(history=history)
        return self._calls.run(lambda: script_text(self._session, STEPS if history else ENDS))

    @contextmanager
    def dry_run(self) -> Iterator[Bus]:
        """Run a block on exact twins of the nodes: nothing is written to the bus.

        The twins answer like the devices and are dropped at the block's end. Calls of other threads raise UsageError
        meanwhile: they may be meant for the devices.
        """
        calls, twins = self._calls, self._session.under(dry_run=True)
        begun = False
        try:
            with calls.alone():
                if calls.rehearsing is not None:
                    raise UsageError("a dry run is already in progress")
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
        """Close the bus and release its nodes for other writers; waits for a running call. May be called twice."""
        network, self._canopen = self._canopen, None
        try:
            if network is not None:
                network.disconnect()
        finally:
            self._calls.close()


def _choose(chosen: dict[int, Any], node_id: int, what: Any, *, met: bool) -> None:
    """Choose *what* for *node_id*; raises UsageError if another was chosen, or the node was *met* with another."""
    before = chosen.get(node_id)
    if met and before != what:
        raise UsageError(f"node {node_id} was used before: give eds and profile at its first use")
    if before not in (None, what):
        raise UsageError(f"node {node_id} already uses {before}, not {what}")
    chosen[node_id] = what


def connect(
    interface: str | None = None,
    channel: str | int | None = None,
    bitrate: int | None = None,
    *,
    timeout_s: float = 0.5,
    journal: str | Path | None = None,
    ask: Callable[[str], bool] | None = None,
    on_message: Callable[[Message], None] | None = None,
    on_progress: Callable[[Progress], None] | None = None,
    **more: object,
) -> Bus:
    """Open a CAN interface by python-can's names; None takes python-can's own configuration.

    *bitrate* is in bit/s, *timeout_s* the SDO time-out in seconds, *journal* the folder of journals and backups (the
    user's state folder), *more* further keys of python-can. *ask* gets questions that a command would ask its user, and
    returns whether to go on; without it, and without `yes=True`, such a call raises SafetyRefusal. *on_message* gets
    the messages of a command beside its result, *on_progress* each step of a change on a node. Raises BusUnavailable if
    the bus cannot be opened.
    """
    if interface is not None:
        word("interface", interface, "a name of python-can, such as 'socketcan'")
    if channel is not None and (isinstance(channel, bool) or not isinstance(channel, str | int)):
        raise wrong("channel", channel, "a name of python-can, such as 'can0', or a number")
    if bitrate is not None:
        whole("bitrate", bitrate, "a bit rate (bit/s)", BIT_RATES[-1], low=BIT_RATES[0])
    given = {
        "interface": interface,
        "channel": None if channel is None else str(channel),
        "bitrate": bitrate,
        "bus_kwargs": tuple(f"{key}={value}" for key, value in more.items()),
        "timeout": seconds("timeout_s", timeout_s),
        "journal": None if journal is None else str(path("journal", journal)),
    }
    call_back(ask=ask, on_message=on_message, on_progress=on_progress)
    return _opened(given, Told(on_message, ask), on_progress)


def simulate(
    *nodes: str,
    faults: tuple[str, ...] | list[str] = (),
    signals: tuple[str, ...] | list[str] = (),
    modules: tuple[str, ...] | list[str] = (),
    timeout_s: float = 0.5,
    ask: Callable[[str], bool] | None = None,
    on_message: Callable[[Message], None] | None = None,
    on_progress: Callable[[Progress], None] | None = None,
) -> Bus:
    """Open a bus of simulated *nodes* in this process: `gen4`, `tmcm@5`, `my.eds@9`.

    *faults*, *signals* and *modules* are words as of `--fault`, `--signal` and `--modules`. Raises UsageError for an
    invalid word.
    """
    given: dict[str, Any] = {
        "sim": simulated_words(nodes),
        "fault": words("faults", faults),
        "signal": words("signals", signals),
        "modules": words("modules", modules),
    }
    given["timeout"] = seconds("timeout_s", timeout_s)
    call_back(ask=ask, on_message=on_message, on_progress=on_progress)
    return _opened(given, Told(on_message, ask), on_progress)


def simulated_words(nodes: tuple[object, ...]) -> tuple[str, ...]:
    """Return the words for simulated *nodes*; raises UsageError if empty, or for a non-text."""
    if not nodes:
        raise UsageError("which node? a family, such as 'generic', or the path of an EDS")
    for node in nodes:
        if not isinstance(node, str | Path) or "\0" in str(node):
            raise UsageError(f"nodes: {node!r}: a family, such as 'generic' or 'generic@5', or the path of an EDS")
    return tuple(map(str, nodes))


def _opened(given: dict[str, Any], told: Told, on_progress: Callable[[Progress], None] | None) -> Bus:
    with errors_in_calls():
        session = Session(options_of({key: value for key, value in given.items() if value is not None}), told)
        network = session.open_network()
    if on_progress is not None:
        network.on_step = lambda progress: in_callers_thread(lambda: on_progress(progress))
    return Bus(session)


class JoinOptions(TypedDict, total=False):
    """Options of `ServedBus.connect` for `dvtcli.connect`."""

    timeout_s: float
    journal: str | Path | None
    ask: Callable[[str], bool] | None
    on_message: Callable[[Message], None] | None
    on_progress: Callable[[Progress], None] | None


@dataclass(frozen=True, slots=True)
class ServedBus:
    """A bus with simulated *nodes* (their node-IDs) that any socketcand client on this machine can join."""

    host: str
    port: int
    nodes: tuple[int, ...]

    @property
    def settings(self) -> dict[str, Any]:
        """Return python-can's arguments to join: `can.Bus(**bus.settings)`."""
        return {"interface": "socketcand", "channel": "can0", "host": self.host, "port": self.port}

    @property
    def words(self) -> tuple[str, ...]:
        """The options for the program `dvtcli` to join: `["dvtcli", *bus.words, "-n", "5", "pdo"]`."""
        return (
            "-i", "socketcand", "-c", "can0", "--bus-kwargs", f"host={self.host}", "--bus-kwargs", f"port={self.port}",
        )  # fmt: skip

    def connect(self, **options: Unpack[JoinOptions]) -> Bus:
        """Join it by `dvtcli.connect` with *options*."""
        return connect(**self.settings, **options)


#: options by the argument's name
_OPTIONS = {"faults": "fault", "signals": "signal", "modules": "modules"}


@contextmanager
def serve(
    *nodes: str,
    faults: Sequence[str] = (),
    signals: Sequence[str] = (),
    modules: Sequence[str] = (),
    state: str | Path | None = None,
) -> Iterator[ServedBus]:
    """Serve simulated *nodes* (`gen4`, `tmcm@5`, `my.eds@9`) on a free loopback port during a block.

    *faults*, *signals* and *modules* are words as of `--fault`, `--signal` and `--modules`; *state* is the folder of
    stored values. Raises UsageError for invalid words, BusUnavailable if no port is free.
    """
    given = {
        "fault": words("faults", faults),
        "signal": words("signals", signals),
        "modules": words("modules", modules),
    }
    options = options_of(given)
    wanted = ServeRequest(simulated_words(nodes), (LOOPBACK, 0), state=None if state is None else path("state", state))
    with serving(options, wanted, LOG.warning) as served:
        thread = threading.Thread(target=served.server.run, name="dvtcli serve", daemon=True)
        thread.start()
        try:
            yield ServedBus(LOOPBACK, served.port or 0, tuple(node.node_id for node in served.nodes))
        finally:
            served.server.stop()
            thread.join()
