"""The socketcand protocol as text: requests of clients in `< … >`, and frames for clients.

See doc/protocol.md of linux-can/socketcand.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from itertools import product

from dvtcli.domain.ports import Frame

HI, OK, ECHO = b"< hi >", b"< ok >", b"< echo >"
UNKNOWN, SYNTAX = b"< error unknown command >", b"< error syntax >"
#: the longest request of a client: a `send` with 8 bytes has 45 characters
LONGEST = 512
#: longest name of a bus, as socketcand has it
_LONGEST_NAME = 16

_DIGITS = b"0123456789abcdefABCDEF"
_ELEMENT = re.compile(rb"[\s\0]*<([^<>]*)>")
_SEND = re.compile(rb"send +([0-9A-Fa-f]{1,8}) +(?:0[xX])?([0-8])((?: +[0-9A-Fa-f]{1,2})*)")
_SEND_RTR = re.compile(rb"sendrtr +([0-9A-Fa-f]{1,8}) +([0-8])")
_BASE_DIGITS = 3
#: every byte as clients write it: `a`, `A`, `0a`, `0A`, `fF`, …
_BYTES = {bytes(digits): int(bytes(digits), 16) for count in (1, 2) for digits in product(_DIGITS, repeat=count)}


class RubbishError(ValueError):
    """The received data is not the protocol."""


@dataclass(slots=True)
class Requests:
    """Splits a client's bytes into requests, however they were divided on the way."""

    _rest: bytes = field(default=b"")

    def feed(self, data: bytes) -> list[bytes]:
        """The requests completed by *data*, without their brackets. Raises RubbishError for anything else."""
        text = self._rest + data
        found, end = [], 0
        while (match := _ELEMENT.match(text, end)) is not None:
            found.append(match[1].strip())
            end = match.end()
        self._rest = text[end:].lstrip(b" \t\r\n\0")
        if self._rest and (not self._rest.startswith(b"<") or len(self._rest) > LONGEST):
            raise RubbishError(f"{self._rest[:32]!r} is no socketcand request")
        return found


def sent_frame(request: bytes) -> Frame | None:
    """The frame of a `send` or `sendrtr`; None for another *request*. Raises ValueError if malformed."""
    match = _SEND.fullmatch(request)
    if match is not None:
        data = bytes(map(_BYTES.__getitem__, match[3].split()))
        if len(data) != int(match[2]):
            raise ValueError("length and data differ")
        return _frame(match[1], data, remote=False)
    if not request.startswith(b"send"):
        return None
    match = _SEND_RTR.fullmatch(request)
    if match is None:
        raise ValueError("no such frame")
    return _frame(match[1], b"", remote=True, dlc=int(match[2]))


def _frame(digits: bytes, data: bytes, *, remote: bool, dlc: int = 0) -> Frame:
    can_id, extended = int(digits, 16), len(digits) > _BASE_DIGITS
    if can_id > (0x1FFF_FFFF if extended else 0x7FF):
        raise ValueError("no such CAN-ID")
    return Frame(can_id, data, extended, remote, dlc=dlc)


def opened_bus(request: bytes) -> bytes | None:
    """The bus name in an `open`; None if *request* is no valid `open`."""
    words = request.split()
    return words[1] if len(words) == 2 and words[0] == b"open" and len(words[1]) <= _LONGEST_NAME else None


def told_frame(frame: Frame, wall_s: float) -> bytes:
    """*frame* in the form for clients; *wall_s* is its time, in seconds since 1970."""
    digits = f"{frame.can_id:08X}" if frame.extended else f"{frame.can_id:03X}"
    if frame.remote:
        return f"< rtr {digits} {wall_s:.6f} {frame.dlc} >".encode()
    return f"< frame {digits} {wall_s:.6f} {frame.data.hex().upper()} >".encode()
