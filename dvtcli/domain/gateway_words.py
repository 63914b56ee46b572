"""The words of a gateway's lines: requests taken apart, values, errors, and answers in the two dialects in use."""

from __future__ import annotations

import base64
import binascii
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum, IntEnum

from dvtcli.domain.abort import abort_text
from dvtcli.domain.datatypes import BY_SHORT_NAME, CanopenTime, DataType, Kind, parse_number
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


#: maximum length of a line (characters): an object of 48 kB as base64
LONGEST_LINE = 65_536
#: maximum number of words: 64 entries of a PDO, each an object with its type
MOST_WORDS = 256
_WORD = re.compile(r'[ \t]*(?:"((?:[^"]|"")*)"(?=[ \t]|$)|(#.*)|([^ \t"#][^ \t"]*))')
#: start of a quoted word: a text, never a number or a command
QUOTED = '"'


def words_of(line: str) -> list[str]:
    """Words of *line*; a quoted word begins with a quote. Raises GatewayRequestError if not text, or too long."""
    if len(line) > LONGEST_LINE:
        raise wrong(f"the line has more than {LONGEST_LINE} characters")
    if not (line.isascii() and line.replace("\t", " ").isprintable()):
        raise wrong("the line has characters that are not ASCII")
    found: list[str] = []
    line = line.rstrip(" \t")
    end = 0
    while end < len(line):
        match = _WORD.match(line, end)
        if match is None:
            raise wrong("a quote is not closed, or is inside a word")
        end = match.end()
        if match[2] is not None:
            break
        found.append(match[3] if match[1] is None else QUOTED + match[1].replace('""', '"'))
        if len(found) > MOST_WORDS:
            raise wrong(f"the line has more than {MOST_WORDS} words")
    return found


def quoted(text: str) -> str:
    """*text* as a word in quotes."""
    return '"' + text.replace('"', '""') + '"'


def number_of(word: str, least: int, most: int, what: str) -> int:
    """The number in *word*, decimal or `0x…`, *least* to *most*. Raises GatewayRequestError otherwise."""
    if re.fullmatch(r"-?0[0-9]+", word):  # C reads it as octal, people do not
        raise wrong(f"{what} {word[:20]}: write the number without a leading zero")
    try:
        number = parse_number(word)
    except ValueError:
        raise wrong(f"{what} {word[:20]!r} is not a number") from None
    if not least <= number <= most:
        raise wrong(f"{what} {number} is not {least} to {most}")
    return number


def wrong(why: str) -> GatewayRequestError:
    """A syntax error, and *why*."""
    return GatewayRequestError(GatewayError.SYNTAX, why)


HEX = "hex"
_OWN = {"b": "bool", "d": "domain"}
_AS_HEX = {f"x{bits}": f"u{bits}" for bits in (8, 16, 32, 64)}
_PLAIN = [name for name in BY_SHORT_NAME if name not in _OWN.values()]
#: data types by their words; `hex` is any bytes
TYPES: dict[str, DataType] = {
    **{name: BY_SHORT_NAME[name] for name in _PLAIN},
    **{name: BY_SHORT_NAME[short] for name, short in (_OWN | _AS_HEX).items()},
    HEX: BY_SHORT_NAME["os"],
}
_BASE64 = (Kind.OCTETS, Kind.UNICODE_STRING)
_REAL = re.compile(r"[+-]?(\d{1,40}\.?\d{0,40}|\.\d{1,40})([eE][+-]?\d{1,4})?", re.ASCII)


def type_word(word: str) -> str:
    """The data type name for *word*. Raises GatewayRequestError if unknown."""
    if word.lower() not in TYPES:
        raise wrong(f"{word[:20]!r} is not a data type")
    return word.lower()


def how_many_words(name: str) -> int | None:
    """Number of words in a value of type *name*; None for any number."""
    return 2 if TYPES[name].kind is Kind.TIME else None if name == HEX else 1


def data_of(name: str, words: Sequence[str]) -> bytes:
    """The bytes of the value *words* of type *name*. Raises GatewayRequestError if they do not fit."""
    kind = TYPES[name]
    many = how_many_words(name)
    if len(words) != (many or len(words)) or not words:
        raise wrong(f"a value of {name} is {many or 'some'} word{'s' if many == 2 else ''}, not {len(words)}")
    if kind.kind is Kind.VISIBLE_STRING:
        return words[0].removeprefix(QUOTED).encode("ascii")
    if kind.kind in _BASE64 and list(words) == [QUOTED]:
        return b""
    if any(word.startswith(QUOTED) for word in words):
        raise wrong(f"write a value of {name} without quotes")
    if name == HEX:
        return _bytes_of(words)
    if kind.kind in _BASE64:
        return _from_base64(words[0])
    if kind.kind is Kind.TIME:
        days, milliseconds = number_of(words[0], 0, 0xFFFF, "days"), number_of(words[1], 0, (1 << 28) - 1, "ms")
        return kind.encode(CanopenTime(milliseconds, days))
    if kind.kind is Kind.REAL:
        return _real(kind, words[0])
    low, high = kind.limits or (0, 0)
    return kind.encode(number_of(words[0], low, high, name))


def value_text(name: str, data: bytes, *, wide_as_hex: bool = False) -> str:
    """*data* as the text of a value of type *name*. Raises ValueError if the length does not fit.

    With *wide_as_hex*, an unsigned number of four bytes and more is written in hexadecimal, as usual for a COB-ID.
    Characters of a VISIBLE_STRING outside printable ASCII are shown as `?`: `os` has the bytes.
    """
    kind = TYPES[name]
    if kind.kind in _BASE64 and not data:
        return quoted("")
    if name == HEX:
        return data.hex(" ").upper()
    if kind.kind in _BASE64:
        return base64.b64encode(data).decode("ascii")
    if kind.kind is Kind.VISIBLE_STRING:
        return quoted("".join(chr(byte) if 0x20 <= byte < 0x7F else "?" for byte in data.rstrip(b"\0")))
    value = kind.decode(data)
    if isinstance(value, CanopenTime):
        return f"{value.days} {value.milliseconds}"
    wide = wide_as_hex and kind.kind is Kind.UNSIGNED and len(data) >= 4
    if (wide or name in _AS_HEX) and isinstance(value, int):
        return f"0x{value:0{2 * len(data)}X}"
    return str(int(value)) if isinstance(value, bool) else str(value)


def _bytes_of(words: Sequence[str]) -> bytes:
    text = "".join(words)
    if not re.fullmatch(r"(?:[0-9A-Fa-f]{2})+", text):
        raise wrong("hex takes bytes of two digits")
    return bytes.fromhex(text)


def _from_base64(word: str) -> bytes:
    try:
        return base64.b64decode(word, validate=True)
    except (binascii.Error, ValueError):
        raise wrong("the value is not valid base64") from None


def _real(kind: DataType, word: str) -> bytes:
    if not _REAL.fullmatch(word):
        raise wrong(f"{word[:20]!r} is not a number")
    try:
        data = kind.encode(float(word))
    except ValueError as refused:
        raise wrong(str(refused)) from None
    if not math.isfinite(float(word)):
        raise wrong(f"{word[:20]} does not fit {kind.name}")
    return data
