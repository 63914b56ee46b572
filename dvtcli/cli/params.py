"""Click types of texts, files, numbers, times, nodes and filters: parsing, completion, error text."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import click
from click.shell_completion import CompletionItem

from dvtcli.cli.global_options import NEGATIVE_MARK
from dvtcli.domain.datatypes import parse_number
from dvtcli.errors import UsageError
from dvtcli.operations.user.options import bit_rate

if TYPE_CHECKING:
    from dvtcli.domain.pdo import Pdo

if TYPE_CHECKING:
    ParamType = click.ParamType[Any]
else:
    ParamType = click.ParamType  # generic only in newer click


class CanopenType(ParamType):
    """A type whose values may begin with a minus sign, and whose ValueErrors become usage errors."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Parse *value* once; click may pass parsed values again."""
        if not isinstance(value, str):
            return value
        try:
            return self.parse(value.removeprefix(NEGATIVE_MARK), ctx)
        except ValueError as wrong:
            self.fail(str(wrong), param, ctx)

    def parse(self, text: str, ctx: click.Context | None) -> Any:
        """Return the value of *text*. Raises ValueError with the reason."""
        raise ValueError(text)


class NumberType(CanopenType):
    """A whole number, decimal or `0x…`, within *low*..*high*."""

    name = "number"

    def __init__(self, low: int, high: int, what: str = "a number") -> None:
        self.low, self.high, self.what = low, high, what

    def parse(self, text: str, ctx: click.Context | None) -> int:
        """Return the number. Raises ValueError if out of range."""
        value = parse_number(text)
        if not self.low <= value <= self.high:
            raise ValueError(f"{text}: {self.what} is {self.low}…{self.high}")
        return value


class MillisecondsType(CanopenType):
    """A time in ms, kept as counts of *unit_us* µs; must be a whole number of counts up to *most*."""

    name = "ms"

    def __init__(self, unit_us: int, most: int = 0xFFFF) -> None:
        self.unit_us, self.most = unit_us, most

    def parse(self, text: str, ctx: click.Context | None) -> int:
        """Return the number of counts."""
        from dvtcli.domain.times import counts, milliseconds

        return counts(milliseconds(text), self.unit_us, self.most)


class TextType(CanopenType):
    """Any text, such as a value to write; only the mark of a leading minus sign is removed."""

    name = "text"

    def parse(self, text: str, ctx: click.Context | None) -> str:
        """The text itself."""
        return text


class FileType(TextType):
    """A file's path, completed by the shell."""

    name = "file"

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """Let the shell complete files."""
        return [CompletionItem(incomplete, type="file")]


#: a node before an object or a PDO: `3:6041`, `3:tpdo1`
_NODE = re.compile(r"\d{1,3}:")


class Listed(click.Argument):
    """Several words of one type, with blanks or commas between them: `tpdo1,tpdo2`."""

    def type_cast_value(self, ctx: click.Context, value: Any) -> Any:
        """Return the values. Raises BadParameter if a word has none."""
        words = [part for word in value or () for part in self._parts(ctx, word)]
        return super().type_cast_value(ctx, tuple(words) or value)

    def _parts(self, ctx: click.Context, word: Any) -> list[Any]:
        """Return *word* taken apart at its commas, unless it is one name with a comma."""
        if not isinstance(word, str) or "," not in word or self._is_value(ctx, word):
            return [word]
        parts = [part for part in word.split(",") if part]
        if not all(self._is_value(ctx, part) for part in parts):
            return [word]
        with_node = [part for part in parts if _NODE.match(part)]
        if with_node and len(with_node) < len(parts):
            raise click.BadParameter(f"{word!r}: write the node before each of them or before none of them", ctx, self)
        return parts

    def _is_value(self, ctx: click.Context, text: str) -> bool:
        try:
            self.type.convert(text, self, ctx)
        except (click.BadParameter, UsageError):
            return False
        return True


TEXT, FILE, NODE_ID = TextType(), FileType(), NumberType(1, 127, "a node-ID")
_TIME = r"(?a)(\d{1,9}(?:\.\d{0,9})?(?:e[+-]?\d{1,2})?|\.\d{1,9})(ms|s|min)?"
_ROTATION_UNITS = {"s": 1.0, "min": 60.0, "h": 3600.0, "kb": 1e3, "mb": 1e6, "gb": 1e9}
_ROTATION = rf"(?a)(\d{{1,9}}(?:\.\d{{0,9}})?)({'|'.join(_ROTATION_UNITS)})"


class DurationType(CanopenType):
    """A time in seconds, written `100ms`, `5s`, `2min`, or as a number of seconds; within *least_s*…*most_s*."""

    name = "time"

    def __init__(self, least_s: float = 0.001, most_s: float = 1e6) -> None:
        self.least_s, self.most_s = least_s, most_s

    def parse(self, text: str, ctx: click.Context | None) -> float:
        """Return the time (s). Raises ValueError if malformed or out of range."""
        found = re.fullmatch(_TIME, text.lower())
        if not found:
            raise ValueError(f"{text!r} is not a time: write 100ms, 5s or 2min")
        value = float(found[1]) * {"ms": 0.001, "s": 1.0, "min": 60.0}[found[2] or "s"]
        if not self.least_s <= value <= self.most_s:
            least = f"{self.least_s * 1000:g} ms" if self.least_s else "0"
            raise ValueError(f"{text} is not within {least}…{self.most_s:.12g} s")
        return value


class RotationType(CanopenType):
    """When a new file begins: after a time, `30s`, `10min`, `1h`, or a size, `500kB`, `100MB`, `1GB`."""

    name = "rotation"

    def parse(self, text: str, ctx: click.Context | None) -> tuple[float, int]:
        """Return seconds and bytes, one of them 0. Raises ValueError if malformed or out of range."""
        found = re.fullmatch(_ROTATION, text.lower())
        if not found:
            raise ValueError(f"{text!r} is neither a time nor a size: write 10min, 1h or 100MB")
        value = float(found[1]) * _ROTATION_UNITS[found[2]]
        if found[2].endswith("b"):
            if not 100_000 <= value <= 1e12:
                raise ValueError(f"{text} is not within 100 kB…1 TB")
            return 0.0, int(value)
        if not 1 <= value <= 1e6:
            raise ValueError(f"{text} is not within 1…1000000 s")
        return value, 0


class NodesType(CanopenType):
    """Node-IDs and their ranges with commas between them: `1,5` or `1,5-9`."""

    name = "nodes"

    def parse(self, text: str, ctx: click.Context | None) -> tuple[int, ...]:
        """Return the node-IDs in order. Raises ValueError if any is outside 1…127."""
        from dvtcli.operations.user.options import node_range

        del ctx
        try:
            return tuple(dict.fromkeys(node for word in text.split(",") for node in node_range(word.strip())))
        except UsageError as wrong:
            raise ValueError(str(wrong)) from wrong


class KindsType(CanopenType):
    """Kinds of frames with commas between them: `pdo,emcy,sdo-abort`."""

    name = "kinds"

    def parse(self, text: str, ctx: click.Context | None) -> frozenset[str]:
        """Return the kinds. Raises ValueError for a word that is none."""
        from dvtcli.domain.typed_frame import READ_KINDS

        words = [word.strip().lower() for word in text.split(",")]
        for word in words:
            if word not in READ_KINDS:
                raise ValueError(f"{word!r} is not a kind of frames; the kinds are {', '.join(READ_KINDS)}")
        return frozenset(words)


class LogFilterType(CanopenType):
    """`ID:MASK` in hexadecimal as in python-can's tools: frames whose CAN-ID equals ID in the bits of MASK.

    A word that is not hexadecimal is searched in names of signals; `speed:` is an error, and `0x181` a CAN-ID.
    """

    name = "filter"

    def parse(self, text: str, ctx: click.Context | None) -> tuple[int, int] | str:
        """CAN-ID and mask; without `:MASK` all bits count. Else the text."""
        head, colon, tail = text.partition(":")
        try:
            can_id, mask = int(head, 16), int(tail, 16) if colon else 0x1FFF_FFFF
        except ValueError:
            if not colon and text.strip():
                return text
            raise ValueError(f"{text!r} is not ID:MASK in hexadecimal, such as 180:780") from None
        if not (0 <= can_id <= 0x1FFF_FFFF and 0 <= mask <= 0x1FFF_FFFF):
            raise ValueError(f"{text}: a CAN-ID has at most 29 bits")
        return can_id, mask


class SinceType(CanopenType):
    """A time in seconds from a recording's first frame on, 0 and more."""

    name = "s"

    def parse(self, text: str, ctx: click.Context | None) -> float:
        """Return the time. Raises ValueError if malformed."""
        return _number(text, "a time in seconds", 1e9)


class RateType(CanopenType):
    """How many times as fast, 0…1000."""

    name = "rate"

    def parse(self, text: str, ctx: click.Context | None) -> float:
        """Return the rate. Raises ValueError if malformed."""
        return _number(text, "how many times as fast", 1000.0)


def _number(text: str, what: str, most: float) -> float:
    try:
        value = float(text)
    except ValueError:
        raise ValueError(f"{text!r} is not {what}") from None
    if not 0 <= value <= most:
        raise ValueError(f"{text} is not {what}, 0…{most:g}")
    return value


class FrameFilterType(CanopenType):
    """A filter of frames in the syntax of `domain.typed_frame`."""

    name = "frames"

    def parse(self, text: str, ctx: click.Context | None) -> str:
        """Return the text itself. Raises ValueError if it is not a filter."""
        from dvtcli.domain.typed_frame import frame_filter

        frame_filter(text)
        return text


class BitRateType(CanopenType):
    """A bit rate in bit/s."""

    name = "bit/s"

    def parse(self, text: str, ctx: click.Context | None) -> int:
        """Return the bit rate in bit/s of `250000`, `250k` or `1M`. Raises ValueError if no bus supports it."""
        try:
            return bit_rate(text)
        except UsageError as wrong:
            raise ValueError(str(wrong)) from None


class PeriodType(CanopenType):
    """A time in *unit*, within *low*…*high*."""

    def __init__(self, unit: str, low: float, high: float) -> None:
        self.name, self.low, self.high = unit, low, high

    def parse(self, text: str, ctx: click.Context | None) -> float:
        """Return the time. Raises ValueError if malformed or out of range."""
        try:
            value = float(text)
        except ValueError:
            raise ValueError(f"{text!r} is not a time in {self.name}") from None
        if not self.low <= value <= self.high:
            raise ValueError(f"{text} {self.name} is not within {self.low:g}…{self.high:g} {self.name}")
        return value


class InhibitType(CanopenType):
    """`5:tpdo3=40`: a TPDO, with node-ID or name unless unique, and its inhibit time."""

    name = "inhibit"

    def parse(self, text: str, ctx: click.Context | None) -> tuple[int | str | None, Pdo, int]:
        """Return node-ID or name (None if absent), TPDO, time in 100 µs. Raises ValueError if malformed."""
        from dvtcli.domain.pdo import Pdo

        head, equals, time = text.partition("=")
        node, colon, word = head.rpartition(":")
        if not equals:
            raise ValueError(f"{text!r} is not [NODE:]tpdoN=MS, such as 5:tpdo3=40")
        pdo = Pdo.parse(word)
        if not pdo.is_tpdo:
            raise ValueError(f"{word}: only TPDOs are inhibited")
        is_number = not colon or node[:1].isdigit() or not node
        node_id = NODE_ID.parse(node, ctx) if colon and is_number else None
        return node_id if is_number else node, pdo, MillisecondsType(100).parse(time, ctx)
