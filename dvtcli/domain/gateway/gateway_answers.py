"""What a gateway answers, in the two dialects that the field has.

`[7] ERROR:0x06020000 #text` is CANopenNode's, `[7] ERROR: 06020000 (text)` Lely's. Does not know requests.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from dvtcli.domain.abort import abort_text
from dvtcli.domain.gateway.error_numbers import GatewayError
from dvtcli.domain.glyphs import ascii_only


class Dialect(Enum):
    """How a failure is written: its text behind `#`, or in brackets."""

    HASH = "hash"
    PAREN = "paren"


@dataclass(frozen=True, slots=True)
class Done:
    """The request was carried out; *value* is what was read, in words, None where nothing was asked for."""

    value: str | None = None


@dataclass(frozen=True, slots=True)
class Failed:
    """The request failed with *code*, a number of the gateway below 1000, else an SDO abort code."""

    code: int
    text: str = ""


Answer = Done | Failed
#: the longest explanation (characters)
_LONGEST_TEXT = 300


def failure_text(code: int) -> str:
    """What *code* means, as the standards say it."""
    if code < 1000:
        return GatewayError(code).text if code in set(GatewayError) else "Unknown error"
    return abort_text(code)


def format_answer(sequence: int | None, answer: Answer, dialect: Dialect = Dialect.HASH) -> str:
    """The line of *answer*, without its end."""
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
    """The line that tells of *error* at a node without being asked, without its end."""
    text = f"({error.text})" if dialect is Dialect.PAREN else f"#{error.text}"
    return f"{net} {node_id} ERROR {error.value} {text}"


def _one_line(text: str) -> str:
    """*text* as it may stand in a line: printable ASCII, others by their look-alikes, and not too long."""
    return "".join(char if 0x20 <= ord(char) < 0x7F else "?" for char in ascii_only(text))[:_LONGEST_TEXT].strip()
