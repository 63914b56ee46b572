"""Click types of the commands that watch and record: times, lists of nodes, filters."""

from __future__ import annotations

import re

import click

from dvtcli.cli.params import NODE_ID, CanopenType


class SecondsType(CanopenType):
    """A time in seconds, more than 0 and at most *most*."""

    name = "s"

    def __init__(self, most: float = 1e6) -> None:
        self.most = most

    def parse(self, text: str, ctx: click.Context | None) -> float:
        """The time; ValueError where it is no number or out of range."""
        try:
            value = float(text)
        except ValueError:
            raise ValueError(f"{text!r} is not a time in seconds") from None
        if not 0 < value <= self.most:
            raise ValueError(f"{text} s is not within 0…{self.most:g} s")
        return value


class DurationType(CanopenType):
    """A time in seconds, written `100ms`, `5s`, `2min`, or as a number of seconds; from 1 ms on."""

    name = "time"

    def parse(self, text: str, ctx: click.Context | None) -> float:
        """The time; ValueError where it is none."""
        found = re.fullmatch(r"(\d{1,9}(?:\.\d{1,9})?)(ms|s|min)?", text.lower(), re.ASCII)
        if not found:
            raise ValueError(f"{text!r} is not a time: write 100ms, 5s or 2min")
        value = float(found[1]) * {"ms": 0.001, "s": 1.0, "min": 60.0}[found[2] or "s"]
        if not 0.001 <= value <= 1e6:
            raise ValueError(f"{text} is not within 1 ms…1000000 s")
        return value


class NodesType(CanopenType):
    """Node-IDs with commas between them: `1,5`."""

    name = "nodes"

    def parse(self, text: str, ctx: click.Context | None) -> tuple[int, ...]:
        """The node-IDs, in their order; ValueError where one is outside 1…127."""
        return tuple(dict.fromkeys(NODE_ID.parse(word.strip(), ctx) for word in text.split(",")))


class LogFilterType(CanopenType):
    """`ID:MASK` in hexadecimal, as python-can's tools take it: frames whose CAN-ID equals ID in the bits of MASK.

    A word that is none is a text in names of signals; `speed:` and `0x181` are no words.
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
        """The time; ValueError where it is none."""
        return _number(text, "a time in seconds", 1e9)


class RateType(CanopenType):
    """How many times as fast, 0…1000."""

    name = "rate"

    def parse(self, text: str, ctx: click.Context | None) -> float:
        """The rate; ValueError where it is none."""
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
    """Which frames are meant, as `domain.frame_filter` takes it."""

    name = "frames"

    def parse(self, text: str, ctx: click.Context | None) -> str:
        """The text itself; ValueError where it means nothing."""
        from dvtcli.domain.frame_filter import frame_filter

        frame_filter(text)
        return text
