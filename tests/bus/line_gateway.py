"""A way to a bus in one file: an ASCII gateway over TCP that reads and writes objects, in the manner of CiA 309-3.

Lines as CANopenNode's gateway has them: `[7] 1 5 r 0x1018 1 hex` is answered `[7] 2B 02 00 00`, `[7] OK` or
`[7] ERROR:0x06020000`; `1 5 BOOT_UP` comes by itself. CAN frames are not carried. For tests, and as a pattern: a
package that has this and the entry point `line-gateway = "package.module:open_bus"` in the group `dvtcli.bus` is chosen
by `-i line-gateway`.
"""

from __future__ import annotations

import re
import socket
from collections import deque
from collections.abc import Mapping
from itertools import count
from select import select
from threading import Lock

from dvtcli.bus.message_bus import MessageBus
from dvtcli.bus.receiver import bus_closed
from dvtcli.bus.sdo.dialogue import no_answer
from dvtcli.bus.sdo.sdo_link import Inbox
from dvtcli.domain.nmt import NmtCommand
from dvtcli.domain.ports import Frame
from dvtcli.errors import BusUnavailable, NoAnswer, SdoAborted, SdoProtocolError, UsageError

#: how much longer than a node the gateway may take itself (s)
GATEWAY_S = 1.0
#: the gateway's number for "the node did not answer"
TIME_OUT = 103
NET = 1
_WORDS = {
    NmtCommand.START: "start",
    NmtCommand.STOP: "stop",
    NmtCommand.ENTER_PRE_OPERATIONAL: "preop",
    NmtCommand.RESET_NODE: "reset node",
    NmtCommand.RESET_COMMUNICATION: "reset comm",
}


def open_bus(
    channel: str | None, _bitrate: int | None, _extra: Mapping[str, object], *, timeout_s: float, retries: int
) -> GatewayBus:
    """Connect to the gateway at *channel*, `HOST:PORT`; whoever opens says what an OSError is."""
    host, _, port = (channel or "").rpartition(":")
    if not host or not port.isdecimal() or int(port) > 0xFFFF:
        raise UsageError(f"channel {channel}: a gateway is HOST:PORT", hint="for example -c 192.168.1.20:60000")
    link = socket.create_connection((host, int(port)), timeout=GATEWAY_S)
    return GatewayBus(link, f"line-gateway:{channel}", timeout_s=timeout_s, retries=retries)


def boot_up_of(line: str) -> Frame | None:
    """The boot-up message that *line* tells of, None where it tells of something else."""
    told = re.fullmatch(r"\d+ (\d+) BOOT_UP", line)
    return None if told is None else Frame(0x700 + int(told[1]), b"\0")


class GatewayBus(MessageBus[str]):
    """Nodes behind a gateway on *link*; a message is one line."""

    def __init__(self, link: socket.socket, name: str, *, timeout_s: float, retries: int) -> None:
        super().__init__(
            name,
            lambda line: boot_up_of(line) or Frame(0, b""),
            carries_frames=False,
            timeout_s=timeout_s,
            retries=retries,
        )
        self._link = link
        self._rest = b""
        self._lines: deque[str] = deque()
        self._numbers = count(1)
        self._inboxes: dict[int, Inbox] = {}
        self._channels: dict[int, Channel] = {}
        self._waits_s = 0.0
        self._put_lock = Lock()

    def ask(self, words: str, timeout_s: float) -> str | None:
        """The gateway's answer to a command, None where it gives none: a node takes *timeout_s* at most."""
        if timeout_s != self._waits_s:
            self._waits_s = timeout_s
            self._asked(f"set sdo_timeout {round(1000 * timeout_s)}", GATEWAY_S)
        return self._asked(words, timeout_s + GATEWAY_S)

    def _asked(self, words: str, wait_s: float) -> str | None:
        number = next(self._numbers)
        inbox = self._inboxes[number] = Inbox()
        try:
            self._put(f"[{number}] {NET} {words}\r\n")
            said = self.take(inbox, self.now_s() + wait_s)
            return None if said is None else said.decode()
        finally:
            del self._inboxes[number]

    def _put(self, line: str) -> None:
        if self._closed:
            raise bus_closed()
        try:
            with self._put_lock:
                self._link.sendall(line.encode())
        except OSError as failed:
            raise self._lost(failed) from failed

    def _lost(self, failed: object) -> BusUnavailable:
        return BusUnavailable(f"{self.name} failed", why=str(failed), hint="is the gateway still running?")

    def _channel(self, node_id: int) -> Channel:
        return self._channels.setdefault(node_id, Channel(self, node_id))

    def _repeated(self, node_id: int) -> int:
        return self._channels[node_id].repeated if node_id in self._channels else 0

    def _command(self, command: NmtCommand, node_id: int) -> None:
        answer = self.ask(f"{node_id} {_WORDS[command]}", GATEWAY_S)
        if answer != "OK":
            raise self._lost(f"it answers {answer!r} to an NMT command")

    def _read(self, wait_s: float) -> str | None:
        try:
            if not self._lines and select([self._link], [], [], wait_s)[0]:
                data = self._link.recv(65536)
                if not data:
                    raise ConnectionResetError("it has closed the connection")
                *lines, self._rest = (self._rest + data).split(b"\n")
                self._lines.extend(line.decode("ascii", "replace").strip() for line in lines)
        except (OSError, ValueError) as failed:
            raise self._lost(failed) from failed
        return self._lines.popleft() if self._lines else None

    def _deliver(self, message: str) -> None:
        answer = re.fullmatch(r"\[(\d+)\] *(.*)", message)
        if answer is not None:
            inbox = self._inboxes.get(int(answer[1]))  # none where it comes too late
            if inbox is not None:
                inbox.put(answer[2].encode())
        elif (frame := boot_up_of(message)) is not None:
            self._traffic.received(message)
            self._heartbeat(frame)

    def _leave(self) -> None:
        self._link.close()


class Channel:
    """The SdoTransport of one node."""

    def __init__(self, bus: GatewayBus, node_id: int) -> None:
        self._bus, self._node_id = bus, node_id
        #: uploads that had to be asked again
        self.repeated = 0

    def upload(
        self, index: int, sub_index: int, *, timeout_s: float | None = None, retries: int | None = None
    ) -> bytes:
        """Read an object; it is asked again where no answer came."""
        left = self._bus.settings.retries if retries is None else retries
        while True:
            try:
                return bytes.fromhex(self._answer(index, sub_index, f"r 0x{index:04X} {sub_index} hex", timeout_s))
            except NoAnswer:
                if not left:
                    raise
                left -= 1
                self.repeated += 1
            except ValueError as wrong:
                raise self._broken(f"{index:04X}:{sub_index:02X}", str(wrong)) from wrong

    def download(self, index: int, sub_index: int, data: bytes, *, timeout_s: float | None = None) -> None:
        """Write an object, once: where no answer comes the device may have taken it."""
        try:
            words = f"w 0x{index:04X} {sub_index} hex {data.hex(' ')}"
            answer = self._answer(index, sub_index, words, timeout_s)
        except (NoAnswer, SdoProtocolError, BusUnavailable) as error:
            error.state = "unknown"
            raise
        if answer != "OK":
            raise self._broken(f"{index:04X}:{sub_index:02X}", f"it answers {answer!r} to a write")

    def _answer(self, index: int, sub_index: int, words: str, timeout_s: float | None) -> str:
        limit_s = self._bus.settings.timeout_s if timeout_s is None else timeout_s
        place = f"{index:04X}:{sub_index:02X}"
        answer = self._bus.ask(f"{self._node_id} {words}", limit_s)
        if answer is None:
            raise no_answer(self._node_id, place, limit_s, "the gateway gave no answer either")
        failed = re.match(r"ERROR: *(0x[0-9A-Fa-f]{8}|\d+)", answer)
        if failed is None:
            return answer
        code = int(failed[1], 0)
        if code == TIME_OUT:
            raise no_answer(self._node_id, place, limit_s)
        if failed[1].startswith("0x"):
            raise SdoAborted(index, sub_index, code, node=self._node_id)
        raise self._broken(place, answer)

    def _broken(self, place: str, why: str) -> SdoProtocolError:
        text = f"the gateway's answer for node {self._node_id} is none (0x{place})"
        return SdoProtocolError(text, node=self._node_id, place=place, why=why)
