"""A bus outside of dvtcli's process: a simulated node behind a socketcand server, as slow as a test wants it."""

from __future__ import annotations

import re
import socket
import struct
import threading
import time
from collections.abc import Callable
from pathlib import Path
from select import select

from dvtcli.domain.ports import Frame
from dvtcli.files.eds.reader import read_eds
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import family_eds, load_family
from dvtcli.simulator.network.station import SimulatedNode
from tests.process import PATIENCE_S

_SEND = re.compile(rb"< send ([0-9A-Fa-f]+) [0-9A-Fa-f] ([0-9a-fA-F ]*)>")
_SDO_DOWNLOAD, _SDO_UPLOAD = 1, 2


class Wire:
    """Serves one of *family* as node *node_id* at `port`; *downloads*, *uploads* and *syncs* say what it was sent.

    It is the device that *eds* describes, by default the family's own.
    """

    def __init__(self, node_id: int = 5, family: str = "gen4", eds: Path | None = None) -> None:
        self.eds: Path = family_eds(family) if eds is None else eds
        self.device = StrictDevice(read_eds(self.eds).dictionary, load_family(family), node_id)
        self.device.boot_up()
        self.device.take_outbox()
        self.downloads = 0
        #: the objects of which an upload was begun, in order
        self.uploads: list[str] = []
        #: how many of them came before the last download
        self.uploads_before_write = 0
        self.syncs = 0
        #: called with the number of each SDO download before the node sees it
        self.at_download: Callable[[int], None] = lambda _number: None
        #: called with the command of each NMT message before the node sees it
        self.at_nmt: Callable[[int], None] = lambda _command: None
        #: seconds that each SDO download takes
        self.slowness_s = 0.0
        #: held while the node is at a frame: whoever looks at the device takes it first, and who starts a process
        #: until it is known what happens at which of its frames
        self.at_work = threading.RLock()
        self._node = SimulatedNode(self.device)
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port: int = self._listener.getsockname()[1]
        self._connection: socket.socket | None = None
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def say(self, can_id: int, data: bytes) -> None:
        """Put a frame on the bus."""
        assert self._connection is not None
        self._connection.sendall(f"< frame {can_id:03X} {time.time():.6f} {data.hex()} >".encode())

    def hang_up(self) -> None:
        """Take the bus away, with a reset as when the server's machine went down."""
        assert self._connection is not None
        self._connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        self._connection.shutdown(socket.SHUT_RD)  # the serving thread wakes and closes it

    def await_frame(self) -> None:
        """In the midst of a frame, wait until another one comes, which is not looked at yet."""
        assert self._connection is not None
        assert select([self._connection], [], [], PATIENCE_S)[0], "nothing comes"

    def close(self) -> None:
        self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()
        if self._connection is not None:
            self._connection.close()
        self._thread.join(2)

    def _serve(self) -> None:
        while True:
            try:
                connection, _ = self._listener.accept()
            except OSError:
                return
            with connection:
                try:
                    self._talk(connection)
                except OSError:
                    continue

    def _talk(self, connection: socket.socket) -> None:
        connection.sendall(b"< hi >")
        for _ in range(2):  # open, rawmode
            if not connection.recv(256):
                return
            self._connection = connection  # before the client hears that it is there
            connection.sendall(b"< ok >")
        pending = b""
        while data := connection.recv(4096):
            pending += data
            *whole, pending = pending.replace(b">", b">\n").split(b"\n")
            for line in whole:
                with self.at_work:
                    self._take(line)

    def _take(self, line: bytes) -> None:
        match = _SEND.fullmatch(line)
        if match is None:
            return
        frame = Frame(int(match[1], 16), bytes(int(byte, 16) for byte in match[2].split()))
        if frame.can_id == 0x600 + self.device.node_id and frame.data[0] >> 5 == _SDO_DOWNLOAD:
            self.downloads += 1
            self.uploads_before_write = len(self.uploads)
            self.at_download(self.downloads)
            time.sleep(self.slowness_s)
        if frame.can_id == 0x600 + self.device.node_id and frame.data[0] >> 5 == _SDO_UPLOAD:
            self.uploads.append(f"{int.from_bytes(frame.data[1:3], 'little'):04X}:{frame.data[3]:02X}")
        if frame.can_id == 0x000:
            self.at_nmt(frame.data[0])
        self.syncs += frame.can_id == 0x080
        for answer in self._node.handle(frame):
            self.say(answer.can_id, answer.data)
