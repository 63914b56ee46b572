"""What a gateway does for a request: the same operations as the commands for it, one answer a request.

Does not know sockets, nor how an answer is written.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.device.store_parameters import SIGNATURES
from dvtcli.domain.datatypes import Kind
from dvtcli.domain.gateway.error_numbers import GatewayError
from dvtcli.domain.gateway.gateway_answers import Answer, Done, Failed
from dvtcli.domain.gateway.requests import Nmt, Order, Read, Write
from dvtcli.domain.gateway.value_words import HEX, value_text
from dvtcli.domain.nmt import NmtCommand
from dvtcli.errors import BusUnavailable, DvtcliError, LeftChanged, NoAnswer, UsageError
from dvtcli.operations.gateway.gateway_lss import LSS, LssLines
from dvtcli.operations.gateway.gateway_pdos import GatewayPdos
from dvtcli.operations.meanings.object_values import type_of
from dvtcli.operations.nodes.command_nmt import command_nmt
from dvtcli.operations.objects.write_object import signature, write_bytes
from dvtcli.version import __version__

if TYPE_CHECKING:
    from dvtcli.domain.gateway.requests import Request
    from dvtcli.operations.gateway.line_client import LineClient
    from dvtcli.operations.session.session import Session

#: the only net that there is
NET = 1
#: how long an SDO of a client may take, since all clients wait meanwhile (ms)
_MOST_SDO_MS = 5000
READ_ONLY = Failed(GatewayError.INTERNAL_STATE, "read-only: this gateway runs without --allow-changes")
_HELP = "r w start stop preop reset set info lss_... (CiA 309-3)"


class GatewayWork:
    """Carries requests out on *session*; changes only where *allow_changes* says so."""

    def __init__(self, session: Session, *, allow_changes: bool) -> None:
        self._session = session
        self._allow_changes = allow_changes
        self._lss = LssLines(session, allow_changes=allow_changes)
        self._pdos = GatewayPdos(session, allow_changes=allow_changes)

    def close(self) -> None:
        """Listen no longer."""
        self._pdos.close()

    def answer(self, client: LineClient, request: Request) -> Answer:
        """What *client* is answered; BusUnavailable and Interrupted end the gateway."""
        net = client.net if request.net is None else request.net
        if net is None:
            return Failed(GatewayError.NO_DEFAULT_NET)
        if net != NET:
            return Failed(GatewayError.UNSUPPORTED_NET)
        timeout_s = client.timeout_s
        given = {} if timeout_s is None else {"timeout": timeout_s}
        try:
            with self._session.under(**given):
                return self._done(client, request)
        except BusUnavailable:
            raise
        except DvtcliError as failed:
            if isinstance(failed, LeftChanged):
                self._session.tell.warning(failed.text)
            return failure(failed)

    def _done(self, client: LineClient, request: Request) -> Answer:
        match request.command:
            case Order(name, numbers) if name in LSS:
                return self._lss.answer(client, name, numbers)
            case Order(name, numbers):
                return _ordered(client, name, numbers)
            case Read() | Write() | Nmt() as command:
                return self._to_node(client.node if request.node is None else request.node, command)
            case command:
                return self._pdos.answer(command)

    def _to_node(self, node_id: int | None, command: Read | Write | Nmt) -> Answer:
        if node_id is None:
            return Failed(GatewayError.NO_DEFAULT_NODE)
        if not (0 if isinstance(command, Nmt) else 1) <= node_id <= 127:
            return Failed(GatewayError.UNSUPPORTED_NODE)
        if not self._allow_changes and not isinstance(command, Read):
            return READ_ONLY
        if not isinstance(command, Nmt):
            try:
                self._session.node(node_id)
            except NoAnswer as silent:
                return Failed(GatewayError.TIME_OUT, _silent(node_id, command, silent))
        if isinstance(command, Read):
            return self._read(node_id, command)
        code = 1
        try:
            answer = (
                self._write(node_id, command) if isinstance(command, Write) else self._nmt(node_id, command.command)
            )
            code = 0
        except DvtcliError as failed:
            code = failed.exit_code
            raise
        finally:
            self._session.end_line(code)
            self._session.cancellation.release()  # what was asked for has ended: Ctrl-C ends the gateway at once again
        return answer

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
            failed = signature(session, node, command.index, command.sub_index, word).failure
        else:
            failed = write_bytes(session, node, command.index, command.sub_index, command.data).failure
        if failed is not None:
            return failure(failed)
        session.tell.note(f"node {node_id}: {place} <- {command.data.hex(' ').upper()}")
        return Done()

    def _nmt(self, node_id: int, command: NmtCommand) -> Answer:
        network = self._session.open_network()
        there = {*self._session.network.nodes, *network.simulated_ids, *network.bus.heard_nodes()}
        done = command_nmt(self._session, command, node_id)
        self._session.tell.note(f"node {node_id or 'all'}: nmt {command.word}")
        if done.exit_code:
            return Failed(GatewayError.WRONG_NMT_STATE)
        seen = {one for one, state in done.states if state is not None}
        if there | seen if not node_id else node_id in there | seen:
            return Done()
        nobody = f"node {node_id} was" if node_id else "a node was"
        return Failed(GatewayError.TIME_OUT, f"sent, and not seen to be obeyed: nothing of {nobody} ever heard")


_LENGTH = 0x0607_0010


def _silent(node_id: int, command: Read | Write, silent: NoAnswer) -> str:
    """What is to be said where a node did not even say who it is, which is asked before anything else."""
    place = f"0x{command.index:04X}:{command.sub_index:02X}"
    return f"node {node_id} did not answer for {place}, nor before that for who it is: {silent.text}"


def failure(failed: DvtcliError) -> Failed:
    """The answer for what *failed*: the node's own abort code, or that of the rule, else a number of the gateway."""
    if failed.abort is not None:
        return Failed(failed.abort, failed.text)
    if isinstance(failed, NoAnswer):
        return Failed(GatewayError.TIME_OUT, failed.text)
    if isinstance(failed, UsageError):
        return Failed(GatewayError.SYNTAX, failed.text)
    return Failed(GatewayError.INTERNAL_STATE, failed.text)


def _ordered(client: LineClient, name: str, numbers: tuple[int, ...]) -> Answer:
    """Do what the order *name* sets for its *client*, or says."""
    match name, numbers:
        case "set network", (net,):
            if net != NET:
                return Failed(GatewayError.UNSUPPORTED_NET)
            client.net = net
        case "set node", (node_id,):
            if not 1 <= node_id <= 127:
                return Failed(GatewayError.UNSUPPORTED_NODE)
            client.node = node_id
        case "set sdo_timeout", (milliseconds,):
            return _set_sdo_time_out(client, milliseconds)
        case "set command_timeout", _:
            pass  # an answer always comes, within the time of its SDOs
        case "boot_up_indication enable" | "boot_up_indication disable", _:
            client.told_boot_ups = name.endswith("enable")
        case "info version", _:
            return Done(f"dvtcli {__version__} CiA 309-3")
        case "help" | "help datatype" | "help lss", _:
            return Done(_HELP)
        case _:
            return Failed(GatewayError.NOT_SUPPORTED)
    return Done()


def _set_sdo_time_out(client: LineClient, milliseconds: int) -> Answer:
    if milliseconds > _MOST_SDO_MS:
        return Failed(GatewayError.SYNTAX, f"at most {_MOST_SDO_MS} ms: all clients wait meanwhile")
    client.timeout_s = milliseconds / 1000
    return Done()


def _word_of(short: str) -> str:
    """The word of a line for the data type that dvtcli calls *short*."""
    return {"bool": "b", "domain": "d"}.get(short, short)
