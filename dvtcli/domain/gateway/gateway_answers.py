"""Answers of a gateway, in the two dialects in use.

`[7] ERROR:0x06020000 #text` is CANopenNode's, `[7] ERROR: 06020000 (text)` Lely's.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, IntEnum

from dvtcli.domain.abort import abort_text
from dvtcli.domain.text import ascii_only


class GatewayError(IntEnum):
    """Error codes of the gateway itself; a node's refusal has an SDO abort code."""

    NOT_SUPPORTED = 100
    SYNTAX = 101
    INTERNAL_STATE = 102
    TIME_OUT = 103
    NO_DEFAULT_NET = 104
    NO_DEFAULT_NODE = 105
    UNSUPPORTED_NET = 106
    UNSUPPORTED_NODE = 107
    HEARTBEAT_STARTED = 202
    HEARTBEAT_LOST = 203
    WRONG_NMT_STATE = 204
    PDO_USED = 400
    PDO_LENGTH = 401
    LSS = 501
    LSS_NODE_ID = 502
    LSS_BIT_RATE = 503
    LSS_STORE = 504
    OUT_OF_MEMORY = 600

    @property
    def text(self) -> str:
        """The number's meaning in words."""
        return _TEXTS[self]


_TEXTS = {
    GatewayError.NOT_SUPPORTED: "Request not supported",
    GatewayError.SYNTAX: "Syntax error",
    GatewayError.INTERNAL_STATE: "Request not processed due to internal state",
    GatewayError.TIME_OUT: "Time-out",
    GatewayError.NO_DEFAULT_NET: "No default net set",
    GatewayError.NO_DEFAULT_NODE: "No default node set",
    GatewayError.UNSUPPORTED_NET: "Unsupported net",
    GatewayError.UNSUPPORTED_NODE: "Unsupported node",
    GatewayError.HEARTBEAT_STARTED: "Heartbeat started",
    GatewayError.HEARTBEAT_LOST: "Heartbeat lost",
    GatewayError.WRONG_NMT_STATE: "Wrong NMT state",
    GatewayError.PDO_USED: "PDO already used",
    GatewayError.PDO_LENGTH: "PDO length exceeded",
    GatewayError.LSS: "LSS error",
    GatewayError.LSS_NODE_ID: "LSS node-ID not supported",
    GatewayError.LSS_BIT_RATE: "LSS bit rate not supported",
    GatewayError.LSS_STORE: "LSS parameter storing failed",
    GatewayError.OUT_OF_MEMORY: "Out of memory",
}


class GatewayRequestError(ValueError):
    """A request to be answered with *error*; the text is the reason for people."""

    def __init__(self, error: GatewayError, why: str) -> None:
        super().__init__(why)
        self.error = error


class Dialect(Enum):
    """Format of a failure: its text behind `#`, or in brackets."""

    HASH = "hash"
    PAREN = "paren"


@dataclass(frozen=True, slots=True)
class Done:
    """The request was carried out; *value* is the value read, in words, None if nothing was read."""

    value: str | None = None


@dataclass(frozen=True, slots=True)
class Failed:
    """The request failed with *code*, a number of the gateway below 1000, else an SDO abort code."""

    code: int
    text: str = ""


Answer = Done | Failed
#: maximum length of an explanation (characters)
_LONGEST_TEXT = 300


def failure_text(code: int) -> str:
    """Meaning of *code* according to the standards."""
    if code < 1000:
        return GatewayError(code).text if code in set(GatewayError) else "Unknown error"
    return abort_text(code)


def format_answer(sequence: int | None, answer: Answer, dialect: Dialect = Dialect.HASH) -> str:
    """The line for *answer*, without its line end."""
    head = "" if sequence is None else f"[{sequence}] "
    if isinstance(answer, Done):
        return head + ("OK" if answer.value is None else answer.value)
    text = _one_line(answer.text or failure_text(answer.code))
    if dialect is Dialect.PAREN:
        code = f"{answer.code}" if answer.code < 1000 else f"{answer.code:08X}"
        return f"{head}ERROR: {code} ({text})"
    code = f"{answer.code}" if answer.code < 1000 else f"0x{answer.code:08X}"
    return f"{head}ERROR:{code} #{text}"


def format_event(net: int, node_id: int, error: GatewayError, dialect: Dialect = Dialect.HASH) -> str:
    """The unsolicited line that reports *error* at a node, without its line end."""
    text = f"({error.text})" if dialect is Dialect.PAREN else f"#{error.text}"
    return f"{net} {node_id} ERROR {error.value} {text}"


def _one_line(text: str) -> str:
    """*text* for a line: printable ASCII, other characters by their look-alikes, and limited in length."""
    return "".join(char if 0x20 <= ord(char) < 0x7F else "?" for char in ascii_only(text))[:_LONGEST_TEXT].strip()
