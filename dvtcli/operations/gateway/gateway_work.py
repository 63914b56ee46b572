"""Carry out gateway requests with the same operations as the commands, an answer each."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from time import monotonic
from typing import TYPE_CHECKING

from dvtcli.device.store.store_parameters import SIGNATURES
from dvtcli.domain.can_ids import HEARTBEAT_BASE
from dvtcli.domain.datatypes import Kind
from dvtcli.domain.gateway_requests import Nmt, Order, Read, Write
from dvtcli.domain.gateway_words import HEX, Answer, Done, Failed, GatewayError, value_text
from dvtcli.domain.lss_services import LssAddress, LssRanges
from dvtcli.domain.nmt import UNCONFIGURED, NmtCommand
from dvtcli.errors import BusUnavailable, DvtcliError, LeftChanged, NoAnswer, UsageError
from dvtcli.operations.gateway.gateway_pdos import GatewayPdos
from dvtcli.operations.gateway.line_client import NET, ordered
from dvtcli.operations.nodes.command_nmt import begin_reset, command_nmt, end_reset
from dvtcli.operations.objects.write_object import signature, write_bytes
from dvtcli.operations.values.object_values import type_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from dvtcli.domain.gateway_requests import Request
    from dvtcli.domain.ports import Frame
    from dvtcli.operations.gateway.line_client import GatewayReporter, LineClient
    from dvtcli.operations.nodes.command_nmt import BegunReset
    from dvtcli.operations.session.session import Session, SessionNodes

#: heartbeat orders
HEARTBEATS = ("enable heartbeat", "disable heartbeat")
#: maximum delay of reading a heartbeat (s): the bus is read once per turn of the gateway
LATE_S = 0.05


class HeartbeatWatches:
    """The heartbeat watches of all clients."""

    def __init__(self, session: SessionNodes) -> None:
        self._session = session
        self._watches: list[Watch] = []
        self._stop: Callable[[], None] | None = None

    def close(self) -> None:
        """Listen no longer."""
        if self._stop is not None:
            self._stop()

    def answer(self, client: LineClient, node_id: int | None, numbers: tuple[int, ...]) -> Answer:
        """Watch *node_id* for *client* from now on, within the time (ms) in *numbers*; no time ends the watch."""
        if node_id is None:
            return Failed(GatewayError.NO_DEFAULT_NODE)
        if not 1 <= node_id <= 127:
            return Failed(GatewayError.UNSUPPORTED_NODE)
        bus = self._session.open_network().bus
        if not bus.carries_frames:
            return Failed(GatewayError.NOT_SUPPORTED, f"{bus.name} carries no CAN frames, so that no heartbeat either")
        self._watches = [watch for watch in self._watches if (watch.client, watch.node_id) != (client, node_id)]
        if numbers:
            self._stop = self._stop or bus.tap(self._note)
            self._watches.append(Watch(client, node_id, numbers[0] / 1000))
        return Done()

    def news(self) -> Iterator[tuple[LineClient, int, GatewayError]]:
        """Yield client, node and error of each event since the last call; drops watches of closed clients."""
        self._watches = [open_watch for open_watch in self._watches if not open_watch.client.gone]
        if not self._watches:
            return
        bus = self._session.open_network().bus
        bus.drain()  # what came while a client's line was done is not missed
        now_s = bus.now_s()
        for watch in self._watches:
            watch.look(now_s)
            while watch.news:
                yield watch.client, watch.node_id, watch.news.pop(0)

    def _note(self, frame: Frame, sent: bool) -> None:
        """Take a heartbeat; called by whoever reads the bus."""
        if sent or frame.extended or frame.remote or len(frame.data) != 1:
            return
        for watch in tuple(self._watches):
            if frame.can_id == HEARTBEAT_BASE + watch.node_id:
                watch.received(frame.timestamp_s, self._session.bus.now_s())


class Watch:
    """A heartbeat watched for *client*: at least every *within_s* seconds, once begun."""

    def __init__(self, client: LineClient, node_id: int, within_s: float) -> None:
        self.client, self.node_id, self._within_s = client, node_id, within_s
        self.news: list[GatewayError] = []
        #: the last heartbeat: time by the bus's clock, and time of reading (s)
        self._stamp_s = 0.0
        self._received_s: float | None = None

    def look(self, now_s: float) -> None:
        """Check for a missed heartbeat, allowing for frames read late."""
        if self._received_s is not None and now_s - self._received_s > self._within_s + LATE_S:
            self._lost()

    def received(self, stamp_s: float, now_s: float) -> None:
        """Take a heartbeat at *stamp_s* of the bus's clock (0: none); consumers wait from the first on.

        Source: CiA 301, 7.2.8.3.2.2.
        """
        if self._received_s is not None and stamp_s > 0 and self._stamp_s > 0:
            if stamp_s - self._stamp_s > self._within_s:
                self._lost()
        else:
            self.look(now_s)
        if self._received_s is None:
            self.news.append(GatewayError.HEARTBEAT_STARTED)
        self._stamp_s, self._received_s = stamp_s, now_s

    def _lost(self) -> None:
        self._received_s = None
        self.news.append(GatewayError.HEARTBEAT_LOST)


#: how long a client may delay others by silent nodes (s); afterwards, how long such a node is not asked again for it
#: (s)
WAITING_S, SILENT_S = 5.0, 10.0


class GatewayWork:
    """Carries out requests on *session*; changes only with *allow_changes*; *reporter* gets changes."""

    def __init__(self, session: Session, reporter: GatewayReporter, *, allow_changes: bool) -> None:
        self._session, self._tell = session, reporter
        self._allow_changes = allow_changes
        self._lss = LssLines(session, allow_changes=allow_changes)
        self._pdos = GatewayPdos(session, allow_changes=allow_changes)
        self.heartbeats = HeartbeatWatches(session)
        self._resets: list[_Reset] = []
        #: until when (s) a node is taken for silent: it did not answer a request
        self._silent_until_s: dict[int, float] = {}
        #: whether a line wrote or commanded anything, and the last failed roll-back
        self._wrote = False
        self._left: LeftChanged | None = None

    def close(self) -> None:
        """Listen no longer."""
        self._pdos.close()
        self.heartbeats.close()

    def ended_by(self, gone: BusUnavailable) -> DvtcliError:
        """Make the error if the bus is *gone*: a client's failed roll-back, else the nodes' state."""
        if self._left is not None:
            self._left.details.append(("then", str(gone)))
            return self._left
        if self._wrote and gone.state == "unchanged":
            gone.state, gone.state_text = "unknown", "what clients wrote is as their answers said; nobody read it again"
        return gone

    def answer(self, client: LineClient, request: Request, *, alone: bool) -> Answer | None:
        """Answer *client*, None if `later` does; BusUnavailable and Interrupted end the gateway.

        Unless *alone*, no node gets a longer time-out than in the options.
        """
        net = client.net if request.net is None else request.net
        if net is None:
            return Failed(GatewayError.NO_DEFAULT_NET)
        if net != NET:
            return Failed(GatewayError.UNSUPPORTED_NET)
        with self._in_the_name_of(client):
            return self._tried(client, lambda: self._done(client, request, alone=alone), alone=alone)

    @contextmanager
    def _in_the_name_of(self, client: LineClient) -> Iterator[None]:
        """Attribute the events of a block to *client*."""
        self._tell.client = client.name
        try:
            yield
        finally:
            self._tell.client = None

    def later(self) -> Iterator[tuple[LineClient, Request, Answer]]:
        """Yield delayed answers when ready, even of closed clients."""
        for reset in [ended_reset for ended_reset in self._resets if ended_reset.begun.sent.is_over()]:
            self._resets.remove(reset)
            ended = partial(self._end_reset, reset)
            with self._in_the_name_of(reset.client):
                answer = self._tried(reset.client, ended, alone=False)
            if answer is not None:
                yield reset.client, reset.request, answer

    def waits(self, client: LineClient) -> bool:
        """Tell whether *client* waits for `later`: its other requests wait."""
        return any(reset.client is client for reset in self._resets)

    def must_wait(self, client: LineClient, request: Request) -> bool:
        """Tell whether *request* is about a node that is still restarting."""
        if not isinstance(request.command, Read | Write | Nmt):
            return False
        node_id = _node_of(client, request)
        return any(node_id in (0, reset.begun.node_id) for reset in self._resets)

    def _tried(self, client: LineClient, work: Callable[[], Answer | None], *, alone: bool) -> Answer | None:
        """Return the answer of *work* for *client*, or its failure."""
        given, usual_s = {}, self._session.options.timeout
        if client.timeout_s is not None:
            given["timeout"] = client.timeout_s if alone else min(client.timeout_s, usual_s)
        try:
            with self._session.under(**given):
                return work()
        except BusUnavailable:
            raise
        except DvtcliError as failed:
            if isinstance(failed, LeftChanged):
                self._left = failed
                self._tell.warning(failed.text)
            return failure(failed)

    def _done(self, client: LineClient, request: Request, *, alone: bool) -> Answer | None:
        match request.command:
            case Order(name, numbers) if name in LSS:
                self._wrote |= self._allow_changes
                return self._lss.answer(client, name, numbers)
            case Order(name, numbers) if name in HEARTBEATS:
                return self.heartbeats.answer(client, _node_of(client, request), numbers)
            case Order(name, numbers):
                return ordered(client, name, numbers)
            case Read() | Write() | Nmt() as command:
                return self._to_node(client, request, command, alone=alone)
            case command:
                return self._pdos.answer(command)

    def _to_node(
        self, client: LineClient, request: Request, command: Read | Write | Nmt, *, alone: bool
    ) -> Answer | None:
        node_id = _node_of(client, request)
        if node_id is None:
            return Failed(GatewayError.NO_DEFAULT_NODE)
        if not (0 if isinstance(command, Nmt) else 1) <= node_id <= 127:
            return Failed(GatewayError.UNSUPPORTED_NODE)
        if not self._allow_changes and not isinstance(command, Read):
            return READ_ONLY
        if not isinstance(command, Nmt):
            silent = self._silence(client, node_id, command, alone=alone)
            if silent is not None:
                return silent
        if isinstance(command, Read):
            with self._counted(client, node_id):
                return self._read(node_id, command)
        with self._line():
            if isinstance(command, Write):
                return self._write(node_id, command)
            if node_id and command.command.is_reset:
                self._resets.append(_Reset(client, request, begin_reset(self._session, command.command, node_id)))
                self._note_nmt(node_id, command.command)
                return None
            return self._nmt(node_id, command.command)

    def _silence(self, client: LineClient, node_id: int, command: Read | Write, *, alone: bool) -> Failed | None:
        """Return the failure if the node cannot be identified, or was silent and *client* has delayed others."""
        left_s = self._silent_until_s.get(node_id, 0.0) - monotonic()
        if left_s > 0 and not alone and client.waited_s > WAITING_S:
            return Failed(GatewayError.TIME_OUT, _known_silent(node_id, left_s))
        try:
            with self._counted(client, node_id):
                self._session.node(node_id)
        except NoAnswer as silent:
            return Failed(GatewayError.TIME_OUT, _silent(node_id, command, silent))
        return None

    @contextmanager
    def _counted(self, client: LineClient, node_id: int) -> Iterator[None]:
        """Count the time of a block against *client* if the node is silent."""
        begun_s = monotonic()
        try:
            yield
            self._silent_until_s.pop(node_id, None)
        except NoAnswer:
            ended_s = monotonic()
            self._silent_until_s[node_id] = ended_s + SILENT_S
            client.waited_s += ended_s - begun_s
            raise

    @contextmanager
    def _line(self) -> Iterator[None]:
        """A block of changes: at its end nodes return to their NMT states."""
        code, self._wrote = 1, True
        try:
            yield
            code, self._left = 0, None
        except DvtcliError as failed:
            code = failed.exit_code
            raise
        finally:
            self._session.end_line(code)
            self._session.cancellation.release()  # what was asked for has ended: Ctrl-C ends the gateway at once again

    def _read(self, node_id: int, command: Read) -> Answer:
        node = self._session.node(node_id)
        data = node.upload(command.index, command.sub_index)
        name = command.data_type
        if name is None:
            own = type_of(node, command.index, command.sub_index, len(data))
            name = _word_of(own.short) if own.size in (None, len(data)) else HEX
            name = HEX if own.kind is Kind.OCTETS else name
        try:
            return Done(value_text(name, data))
        except ValueError as wrong:
            return Failed(_LENGTH, str(wrong))

    def _write(self, node_id: int, command: Write) -> Answer:
        session, place = self._session, f"0x{command.index:04X}:{command.sub_index:02X}"
        node = session.node(node_id)
        if command.index in SIGNATURES:
            taken = SIGNATURES[command.index]
            word = taken.decode() if command.data == taken else command.data.hex()
            signature(session, node, command.index, command.sub_index, word)
        else:
            write_bytes(session, node, command.index, command.sub_index, command.data)
        secret = (command.index, command.sub_index) in session.secrets.objects
        data = None if secret else command.data.hex(" ").upper()
        text = f"node {node_id}: {place} <- {'(a passcode)' if secret else data}"
        self._tell.happened("written", text, node=node_id, object=place.removeprefix("0x"), data=data)
        return Done()

    def _nmt(self, node_id: int, command: NmtCommand) -> Answer:
        done = command_nmt(self._session, command, node_id)
        self._note_nmt(node_id, command)
        if done.exit_code:
            return Failed(GatewayError.WRONG_NMT_STATE)
        if done and done.states:
            return Done()
        unseen = ", ".join(str(unseen_id) for unseen_id, state in done.states if state is None)
        nobody = f"node {unseen} does not report its NMT state" if unseen else "no node was ever received"
        return Failed(GatewayError.TIME_OUT, f"sent, and not seen to be obeyed: {nobody}")

    def _note_nmt(self, node_id: int, command: NmtCommand) -> None:
        self._tell.happened("nmt", f"node {node_id or 'all'}: nmt {command.word}", node=node_id)

    def _end_reset(self, reset: _Reset) -> Answer:
        with self._line():
            done = end_reset(self._session, reset.begun)
        return Failed(GatewayError.WRONG_NMT_STATE) if done.exit_code else Done()


@dataclass(frozen=True, slots=True)
class _Reset:
    """A node's restart that only *client*, and requests for the node, wait for."""

    client: LineClient
    request: Request
    begun: BegunReset


_LENGTH = 0x0607_0010


def _node_of(client: LineClient, request: Request) -> int | None:
    """Return the node of *request*, else the client's default; None if neither."""
    return client.node if request.node is None else request.node


def _silent(node_id: int, command: Read | Write, silent: NoAnswer) -> str:
    """Describe a node that could not even be identified, before any other access."""
    place = f"0x{command.index:04X}:{command.sub_index:02X}"
    return f"node {node_id} did not answer for {place}, nor before that for who it is: {silent.text}"


def _known_silent(node_id: int, left_s: float) -> str:
    return (
        f"node {node_id} was silent, and you made others wait for more than {WAITING_S:g} s: it is asked again in "
        f"{left_s:.1f} s, or once you are alone"
    )


def failure(failed: DvtcliError) -> Failed:
    """Return the failure: the node's abort code, or the rule's, else a gateway error number."""
    if failed.abort is not None:
        return Failed(failed.abort, failed.text)
    if isinstance(failed, NoAnswer):
        return Failed(GatewayError.TIME_OUT, failed.text)
    if isinstance(failed, UsageError):
        return Failed(GatewayError.SYNTAX, failed.text)
    return Failed(GatewayError.INTERNAL_STATE, failed.text)


def _word_of(short: str) -> str:
    """Return the gateway word for the data type *short*."""
    return {"bool": "b", "domain": "d"}.get(short, short)


#: LSS orders
LSS = (
    "lss_switch_glob", "lss_switch_sel", "lss_set_node", "lss_conf_bitrate", "lss_activate_bitrate", "lss_store",
    "lss_inquire_addr", "lss_get_node", "lss_identity", "lss_ident_nonconf", "_lss_fastscan",
)  # fmt: skip
#: command specifier of the first part of an address (CiA 305)
_FIRST_PART = 0x5A
#: orders that change a slave, if only its LSS state: a fast scan puts the slave found in configuration, too (CiA
#: 305)
_CHANGES = ("lss_set_node", "lss_store", "lss_switch_sel", "_lss_fastscan")
_SWITCH_ALL = ("lss_switch_glob", (1,))
_RATES = "a bus whose nodes run at two bit rates is dead; dvtcli changes the rate of all, and takes it back"
_ALL = "all slaves at once would get one node-ID; lss_switch_sel selects one"
READ_ONLY = Failed(GatewayError.INTERNAL_STATE, "read-only: this gateway allows no changes")


class LssLines:
    """LSS orders of all clients: a bus has a single LSS master, so each order selects its slave again."""

    def __init__(self, session: SessionNodes, *, allow_changes: bool) -> None:
        self._session = session
        self._allow_changes = allow_changes

    def answer(self, client: LineClient, name: str, numbers: tuple[int, ...]) -> Answer:
        """Return the answer to the order *name* of *client*."""
        if not self._allow_changes and (name in _CHANGES or (name, numbers) == _SWITCH_ALL):
            return READ_ONLY
        if self._session.dry_run:
            return Failed(GatewayError.INTERNAL_STATE, "dry run: no LSS is sent, so that nobody can answer")
        return self._answered(client, name, numbers)

    def _answered(self, client: LineClient, name: str, numbers: tuple[int, ...]) -> Answer:
        match name, numbers:
            case "lss_switch_glob", (0,):
                client.selected = None
                return Done()
            case "lss_switch_sel", (vendor, product, revision, serial):
                return self._select(client, LssAddress(vendor, product, revision, serial))
            case "lss_identity" | "lss_ident_nonconf", _:
                return self._identify(numbers)
            case "_lss_fastscan", _:
                return self._scan()
            case "lss_conf_bitrate" | "lss_activate_bitrate", _:
                return Failed(GatewayError.NOT_SUPPORTED, _RATES)
            case "lss_switch_glob", _:
                return Failed(GatewayError.NOT_SUPPORTED, _ALL)
        if client.selected is None:
            return Failed(GatewayError.LSS, "no slave is selected: lss_switch_sel comes first")
        return self._of_selected(client.selected, name, numbers)

    def _select(self, client: LineClient, address: LssAddress) -> Answer:
        client.selected = None
        self._node_id(address)
        client.selected = address
        return Done()

    def _node_id(self, address: LssAddress) -> int:
        """Return the slave's current node-ID, 255 for none: another client may have set it."""
        from dvtcli.operations.lss.lss_find import lss_select

        # It waits again at once, and each order selects it again: a client that leaves leaves no slave in
        # configuration.
        found = lss_select(self._session, address, keep=False)
        node_id = found.nodes[0].node_id if found.nodes else None
        return UNCONFIGURED if node_id is None else node_id

    def _identify(self, numbers: tuple[int, ...]) -> Answer:
        """Tell whether a slave is within the ranges, or has no node-ID if none are given."""
        from dvtcli.operations.lss.lss_find import lss_identify

        if numbers:
            vendor, product, low_revision, high_revision, low_serial, high_serial = numbers
            wanted = LssRanges(vendor, product, (low_revision, high_revision), (low_serial, high_serial))
            there = bool(lss_identify(self._session, wanted).within)
        else:
            there = bool(lss_identify(self._session, None).answered)
        return Done() if there else Failed(GatewayError.TIME_OUT, "no slave answered")

    def _scan(self) -> Answer:
        """Return the address of the first slave without a node-ID."""
        from dvtcli.operations.lss.lss_find import lss_scan

        found = lss_scan(self._session).nodes
        if not found:
            return Failed(GatewayError.TIME_OUT, "no slave waits for a node-ID")
        return Done(" ".join(f"0x{part:08X}" for part in found[0].address.parts))

    def _of_selected(self, address: LssAddress, name: str, numbers: tuple[int, ...]) -> Answer:
        if name == "lss_inquire_addr":
            part = numbers[0] if numbers else 0
            part = part - _FIRST_PART if part >= _FIRST_PART else part
            if part > 3:
                return Failed(GatewayError.SYNTAX, "an address has the parts 0 to 3, or 0x5A to 0x5D")
            return Done(f"0x{address.parts[part]:08X}")
        if name == "lss_get_node":
            return Done(str(self._node_id(address)))
        return self._set_node(address, numbers[0]) if name == "lss_set_node" else self._store(address)

    def _store(self, address: LssAddress) -> Answer:
        from dvtcli.operations.lss.lss_node_id import lss_store

        node_id = self._node_id(address)
        if node_id == UNCONFIGURED:
            return Failed(GatewayError.LSS_STORE, "the slave has no node-ID to store")
        done = lss_store(self._session, node_id)
        return Failed(GatewayError.LSS_STORE) if done.exit_code else Done()

    def _set_node(self, address: LssAddress, node_id: int) -> Answer:
        from dvtcli.operations.lss.lss_node_id import lss_node_id

        if not 1 <= node_id <= 127:
            return Failed(GatewayError.LSS_NODE_ID)
        done = lss_node_id(self._session, node_id, address)
        if done.exit_code:
            return Failed(GatewayError.LSS_NODE_ID)
        self._session.reporter.note(f"node-ID {node_id} <- {address}")
        return Done()
