"""canopen's own RemoteNode on a dvtcli bus, for programs that use canopen.

SDO goes through a given SdoTransport, so that both sides never use a channel at the same time; a separate thread
forwards received frames.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from queue import SimpleQueue
from typing import Any, cast

import can
import canopen
from canopen import SdoAbortedError, SdoCommunicationError, objectdictionary
from canopen.sdo.client import SdoClient

from dvtcli.bus.can_message import frame_of
from dvtcli.domain.can_ids import NMT_ID, SDO_REQUEST_BASE, SDO_RESPONSE_BASE
from dvtcli.domain.nmt import NmtCommand
from dvtcli.domain.object_dictionary import ObjectDictionary, ObjectType, OdEntry
from dvtcli.domain.ports import CanopenBus, Frame, SdoTransport
from dvtcli.errors import BusUnavailable, DvtcliError, SdoAborted

#: Interval in seconds at which the reading thread checks whether to end.
_LISTEN_S = 0.1


class CanopenNetwork(canopen.Network):
    """A canopen network on *bus*, which stays open after a disconnect.

    The network shares all frames of *bus*; call-backs come in a thread of their own and may use the bus. *refuse*
    is called before a frame is sent, and raises to forbid it.
    """

    def __init__(self, bus: CanopenBus, refuse: Callable[[], None] = lambda: None) -> None:
        super().__init__(_Sender(bus, refuse))
        self._received: SimpleQueue[Frame | None] = SimpleQueue()
        self._open = True
        self._untap = bus.tap(lambda frame, sent: None if sent else self._received.put(frame))
        self._shared = bus
        self._threads = [threading.Thread(target=work, daemon=True) for work in (self._listen, self._hand_on)]
        for thread in self._threads:
            thread.start()

    def _listen(self) -> None:
        """Read the bus while no other thread does."""
        try:
            while self._open:
                self._shared.idle(_LISTEN_S)
        except BusUnavailable:
            return  # the users of the bus get the error
        finally:
            self._received.put(None)

    def _hand_on(self) -> None:
        while (frame := self._received.get()) is not None:
            self.notify(frame.can_id, bytearray(frame.data), frame.timestamp_s)

    def disconnect(self) -> None:
        """Stop periodic frames and the forwarding of frames; the bus stays open. May be called twice."""
        if self._open:
            self._open = False
            self._untap()
            super().disconnect()
            for thread in self._threads:
                if thread is not threading.current_thread():  # a call-back may close the bus
                    thread.join()


class _Sender(can.BusABC):
    """A send-only python-can bus over a dvtcli bus."""

    def __init__(self, bus: CanopenBus, refuse: Callable[[], None]) -> None:
        super().__init__(channel=bus.name)
        self.channel_info = bus.name
        self._shared = bus
        self._refuse = refuse

    def send(self, msg: can.Message, timeout: float | None = None) -> None:  # noqa: ARG002 - python-can's interface
        """Send a frame; an NMT command is recorded as a command."""
        self._refuse()
        if msg.arbitration_id == NMT_ID and not msg.is_extended_id and msg.dlc == 2:
            self._shared.send_nmt(NmtCommand(msg.data[0]), msg.data[1])
            return
        self._shared.send(frame_of(msg))

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:  # noqa: ARG002 - as above
        return None, False


class _Client(SdoClient):
    """canopen's SDO client over a shared channel."""

    def __init__(self, node_id: int, od: objectdictionary.ObjectDictionary, channel: SdoTransport) -> None:
        super().__init__(SDO_REQUEST_BASE + node_id, SDO_RESPONSE_BASE + node_id, od)  # type: ignore[no-untyped-call]
        self._channel = channel

    def upload(self, index: int, subindex: int) -> bytes:
        """Read an object; canopen's SdoAbortedError and SdoCommunicationError."""
        with _canopens_errors():
            return self._channel.upload(index, subindex)

    def download(self, index: int, subindex: int, data: bytes, force_segment: bool = False) -> None:  # noqa: ARG002
        """Write an object; errors as `upload`."""
        with _canopens_errors():
            self._channel.download(index, subindex, bytes(data))

    def open(self, *_: Any, **__: Any) -> Any:
        """Raise SdoCommunicationError: a stream would block the channel for all other users."""
        raise SdoCommunicationError("no streams on a shared channel: use upload and download")

    def on_response(self, *_: Any) -> None:
        """Leave answers to the channel."""


@contextmanager
def _canopens_errors() -> Iterator[None]:
    try:
        yield
    except SdoAborted as aborted:
        raise SdoAbortedError(aborted.code) from aborted
    except DvtcliError as failed:
        raise SdoCommunicationError(str(failed)) from failed


class _Node(canopen.RemoteNode):
    """A remote node with a given default SDO channel."""

    def __init__(self, node_id: int, od: objectdictionary.ObjectDictionary, channel: SdoTransport) -> None:
        self._channel: SdoTransport | None = channel
        super().__init__(node_id, od)

    def add_sdo(self, rx_cobid: int, tx_cobid: int) -> SdoClient:
        """Return the given default channel first; further channels are canopen's own."""
        channel, self._channel = self._channel, None
        if channel is None:
            return cast("SdoClient", super().add_sdo(rx_cobid, tx_cobid))  # type: ignore[no-untyped-call]
        client = _Client(rx_cobid - SDO_REQUEST_BASE, self.object_dictionary, channel)
        self.sdo_channels.append(client)
        return client


def remote_node(
    network: CanopenNetwork, node_id: int, dictionary: ObjectDictionary | None, channel: SdoTransport
) -> canopen.RemoteNode:
    """canopen's node *node_id* in *network*, with the objects in *dictionary*; its SDO goes through *channel*."""
    od = canopen_dictionary(dictionary, node_id)
    return network.add_node(_Node(node_id, od, channel))


def canopen_dictionary(dictionary: ObjectDictionary | None, node_id: int) -> objectdictionary.ObjectDictionary:
    """*dictionary* in canopen's form, for *node_id*; empty for None."""
    od = objectdictionary.ObjectDictionary()  # type: ignore[no-untyped-call]
    od.node_id = node_id
    if dictionary is None:
        return od
    for index, held in dictionary.items():
        if held.object_type in (ObjectType.ARRAY, ObjectType.RECORD):
            kind = objectdictionary.ODArray if held.object_type == ObjectType.ARRAY else objectdictionary.ODRecord
            parent = kind(held.name, index)
            for entry in held.entries.values():
                parent.add_member(_variable(entry, node_id))
            od.add_object(parent)
        else:
            od.add_object(_variable(next(iter(held.entries.values())), node_id))
    return od


def _variable(entry: OdEntry, node_id: int) -> objectdictionary.ODVariable:
    variable = objectdictionary.ODVariable(entry.name, entry.index, entry.sub_index)
    variable.data_type = None if entry.data_type is None else entry.data_type.code
    variable.access_type = str(entry.access)
    variable.pdo_mappable = bool(entry.pdo_mapping)
    variable.unit = entry.unit
    limits: tuple[Any, Any] = entry.limits(node_id)
    variable.min, variable.max = limits
    initial = entry.initial(node_id)
    if initial is not None and entry.data_type is not None and len(initial) == entry.data_type.size:
        default: Any = entry.data_type.decode(initial)
        variable.default = default
    return variable
