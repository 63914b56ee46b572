"""Click types of the commands that watch and record: times, lists of nodes, filters."""

from __future__ import annotations

import re

import click

from dvtcli.cli.params import NODE_ID, CanopenType

_TIME = re.compile(r"(\d{1,9}(?:\.\d{0,9})?(?:e[+-]?\d{1,2})?|\.\d{1,9})(ms|s|min)?", re.ASCII)

_ROTATION_UNITS = {"s": 1.0, "min": 60.0, "h": 3600.0, "kb": 1e3, "mb": 1e6, "gb": 1e9}
_ROTATION = re.compile(rf"(\d{{1,9}}(?:\.\d{{0,9}})?)({'|'.join(_ROTATION_UNITS)})", re.ASCII)


class DurationType(CanopenType):
    """A time in seconds, written `100ms`, `5s`, `2min`, or as a number of seconds; within *least_s*…*most_s*."""

    name = "time"

    def __init__(self, least_s: float = 0.001, most_s: float = 1e6) -> None:
        self.least_s, self.most_s = least_s, most_s

    def parse(self, text: str, ctx: click.Context | None) -> float:
        """Return the time (s). Raises ValueError if malformed or out of range."""
        found = _TIME.fullmatch(text.lower())
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
        found = _ROTATION.fullmatch(text.lower())
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
    """Node-IDs with commas between them: `1,5`."""

    name = "nodes"

    def parse(self, text: str, ctx: click.Context | None) -> tuple[int, ...]:
        """Return the node-IDs in order. Raises ValueError if any is outside 1…127."""
        return tuple(dict.fromkeys(NODE_ID.parse(word.strip(), ctx) for word in text.split(",")))


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
        """Return the text itself. Raises ValueError if it is no filter."""
        from dvtcli.domain.typed_frame import frame_filter

        frame_filter(text)
        return text
