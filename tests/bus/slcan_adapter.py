"""An slcan adapter on a pseudo-terminal, as strict as its protocol, between a serial line and a virtual CAN channel.

It answers each command with CR or BEL, takes frames only while its channel is open, a bit rate only while it is closed,
and no line that is not exact. What can go wrong on such a line can be had: lines in pieces, late, with lost characters,
a full transmit buffer, and the plug pulled.
"""

from __future__ import annotations

import os
import re
import select
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from math import inf
from pathlib import Path

import can
import pytest

from tests.posix import NO_TERMINAL

OK, ERROR = b"\r", b"\a"
_FRAME = re.compile(rb"(?:[tr]([0-7][0-9A-F]{2})|[TR]([01][0-9A-F]{7}))([0-8])((?:[0-9A-F]{2})*)", re.IGNORECASE)
_BIT_RATES = dict(enumerate((10, 20, 50, 100, 125, 250, 500, 800, 1000)))


@dataclass
class Line:
    """What the serial line does to what the adapter says: it comes in *pieces* of so many bytes, *late_s* seconds late.

    Of the bytes that carry frames each *losing*-th is lost (0: none).
    """

    pieces: int = 0
    late_s: float = 0.0
    losing: int = 0
    _count: int = 0

    def worn(self, text: bytes) -> bytes:
        """*text* without the bytes that are lost."""
        if not self.losing:
            return text
        kept = bytearray()
        for byte in text:
            self._count += 1
            if self._count % self.losing:
                kept.append(byte)
        return bytes(kept)


@dataclass
class SlcanAdapter:
    """The adapter; its bus is the virtual *channel*. Each *refusing*-th frame to send gets BEL for an answer,
    and so does each whose data begin with *refused*.
    """

    channel: str
    line: Line = field(default_factory=Line)
    refusing: int = 0
    refused: bytes | None = None
    #: told its bit rate (bit/s, 0 while it is closed), and whether it only listens
    tune: Callable[[int, bool], None] = lambda _bit_rate, _listening: None
    #: what it was asked that it did not understand, or not now
    complaints: list[bytes] = field(default_factory=list)
    bit_rate_kbit: int | None = None
    is_open: bool = False
    listening: bool = False
    #: how it was opened so far: `O` to speak, `L` to listen
    opened: set[bytes] = field(default_factory=set)
    sent: int = 0
    #: since when it hears frames at this bit rate (s of time.time)
    _open_since: float = inf

    def __enter__(self) -> SlcanAdapter:
        tty = pytest.importorskip("tty", reason=NO_TERMINAL)
        self._master, slave = os.openpty()
        tty.setraw(slave)
        self.port = os.ttyname(slave)
        self._slave = slave
        self._bus = can.Bus(self.channel, interface="virtual", ignore_config=True)
        self._stopping = threading.Event()
        self._writing = threading.Lock()
        self._threads = [threading.Thread(target=each, daemon=True) for each in (self._listen, self._forward)]
        for thread in self._threads:
            thread.start()
        return self

    def __exit__(self, *_exception: object) -> None:
        self.unplug()
        self._bus.shutdown()

    def plug_into(self, folder: Path) -> Path:
        """A name in *folder* as a USB port has it in /dev."""
        name = folder / "ttyACM0"
        name.symlink_to(self.port)
        return name

    def unplug(self) -> None:
        """Pull the plug: whoever has the port open loses it."""
        if self._stopping.is_set():
            return
        self._stopping.set()
        for thread in self._threads:
            thread.join()
        os.close(self._slave)
        os.close(self._master)

    def _listen(self) -> None:
        text = b""
        while not self._stopping.is_set():
            if not select.select([self._master], [], [], 0.02)[0]:
                continue
            text += os.read(self._master, 4096)
            *lines, text = text.split(b"\r")
            for line in lines:
                self._say(self._obey(line))

    def _obey(self, line: bytes) -> bytes:
        """Do what *line* asks; the answer."""
        answer = self._answer(line)
        if answer == ERROR:
            self.complaints.append(line)
        return answer

    def _answer(self, line: bytes) -> bytes:
        if line in (b"O", b"L") and (self.is_open or self.bit_rate_kbit is None):
            return ERROR
        if line in (b"O", b"L", b"C"):
            self.opened |= {line} - {b"C"}
            self.is_open, self.listening = line != b"C", line == b"L"
            self._open_since = inf
            self.tune(1000 * (self.bit_rate_kbit or 0) if self.is_open else 0, self.listening or not self.is_open)
            self._open_since = time.time()
            return OK
        if line == b"":
            return OK
        if line[:1] == b"S" and line[1:].isdigit() and int(line[1:]) in _BIT_RATES and not self.is_open:
            self.bit_rate_kbit = _BIT_RATES[int(line[1:])]
            return OK
        if line in (b"V", b"N", b"F"):
            return {b"V": b"V1013", b"N": b"NA123", b"F": b"F00"}[line] + OK
        return self._send(line) if self.is_open and not self.listening else ERROR

    def _send(self, line: bytes) -> bytes:
        """Put the frame of *line* on the bus."""
        match = _FRAME.fullmatch(line)
        if match is None:
            return ERROR
        short, extended, count, data = match.groups()
        remote = line[:1] in b"rR"
        if len(data) != (0 if remote else 2 * int(count)):
            return ERROR
        self.sent += 1
        if self.refusing and self.sent % self.refusing == 0:
            return ERROR
        if self.refused is not None and data.upper().startswith(self.refused.hex().upper().encode()):
            return ERROR
        self._bus.send(
            can.Message(
                arbitration_id=int(short or extended, 16), is_extended_id=short is None, is_remote_frame=remote,
                dlc=int(count), data=None if remote else bytes.fromhex(data.decode()),
            )
        )  # fmt: skip
        return (b"z" if short is not None else b"Z") + OK

    def _forward(self) -> None:
        """Tell the computer what is on the bus."""
        while not self._stopping.is_set():
            frame = self._bus.recv(0.02)
            if frame is None or not self.is_open or frame.timestamp < self._open_since:
                continue  # it was not heard, however late it is read here
            letter = "r" if frame.is_remote_frame else "t"
            letter = letter.upper() if frame.is_extended_id else letter
            number = f"{frame.arbitration_id:0{8 if frame.is_extended_id else 3}X}"
            data = "" if frame.is_remote_frame else frame.data.hex().upper()
            self._say(self.line.worn(f"{letter}{number}{frame.dlc}{data}\r".encode()))

    def _say(self, text: bytes) -> None:
        with self._writing:
            size = self.line.pieces or len(text)
            for place in range(0, len(text), size):
                if self.line.late_s:
                    time.sleep(self.line.late_s)
                os.write(self._master, text[place : place + size])
