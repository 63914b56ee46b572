"""A TCP line between socketcand clients and their server that loses frames, is cut, is gone for a while, and is full.

Knows the protocol's brackets; does not know what the frames mean.
"""

from __future__ import annotations

import random
import socket
import threading
from contextlib import suppress

_ONE = b" >"


class Cable:
    """Listens at `port`, and carries what comes to the server at *to_port*; *losing* is the share of lost frames."""

    def __init__(self, to_port: int) -> None:
        self._to_port = to_port
        self.losing = 0.0
        self.lost = 0
        self._lots = random.Random(0)
        self._lock = threading.Lock()
        #: client's end, and whether it is past its greeting
        self._lines: list[tuple[socket.socket, socket.socket]] = []
        self._open = threading.Event()
        self._open.set()
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port: int = self._listener.getsockname()[1]
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self) -> None:
        while True:
            try:
                client, _ = self._listener.accept()
            except OSError:
                return
            if not self._open.is_set():
                client.close()
                continue
            server = socket.create_connection(("127.0.0.1", self._to_port))
            with self._lock:
                self._lines.append((client, server))
            for end in (client, server):
                end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            for source, target in ((client, server), (server, client)):
                threading.Thread(target=self._carry, args=(source, target), daemon=True).start()

    def _carry(self, source: socket.socket, target: socket.socket) -> None:
        rest = b""
        with suppress(OSError):
            while data := source.recv(1 << 16):
                *whole, rest = (rest + data).split(b">")
                kept = [one + b">" for one in whole if not self._loses(one)]
                if kept:
                    target.sendall(b"".join(kept))
                if rest and not rest.lstrip().startswith(b"<"):
                    target.sendall(rest)  # no bracket: nothing that is cut into frames
                    rest = b""
        for each in (source, target):
            with suppress(OSError):
                each.shutdown(socket.SHUT_RDWR)
            each.close()

    def _loses(self, one: bytes) -> bool:
        """Whether this frame is lost; what is not a frame never is."""
        if not self.losing or not one.lstrip().startswith((b"< frame", b"< send")):
            return False
        lost = self._lots.random() < self.losing
        self.lost += lost
        return lost

    def cut(self) -> None:
        """End every connection; new ones are taken."""
        with self._lock:
            lines, self._lines = self._lines, []
        for line in lines:
            for each in line:
                with suppress(OSError):
                    each.shutdown(socket.SHUT_RDWR)

    def away(self, seconds: float) -> None:
        """End every connection, and take none for *seconds*."""
        self._open.clear()
        self.cut()
        threading.Event().wait(seconds)
        self._open.set()

    def flood(self, frames: int) -> None:
        """Put *frames* of another producer on the bus, as fast as the server takes them."""
        with suppress(OSError), socket.create_connection(("127.0.0.1", self._to_port)) as busy:
            for word in (b"", b"< open can0 >", b"< rawmode >"):
                busy.sendall(word)
                busy.recv(256)
            for number in range(frames):
                busy.sendall(f"< send 3F0 8 {number.to_bytes(8, 'little').hex(' ')} >".encode())

    def close(self) -> None:
        """Let go of the port and of every connection."""
        self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()
        self.cut()
