"""Click types of `load`: bit rates, periods, and inhibit times of a TPDO."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.cli.params import NODE_ID, CanopenType, MillisecondsType
from dvtcli.operations.user.options import BIT_RATES

if TYPE_CHECKING:
    import click

    from dvtcli.domain.pdo import Pdo


class BitRateType(CanopenType):
    """A bit rate in bit/s."""

    name = "bit/s"

    def parse(self, text: str, ctx: click.Context | None) -> int:
        """Return the bit rate. Raises ValueError if no bus supports it."""
        rate = int(text) if text.isascii() and text.isdigit() and len(text) < 9 else 0
        if rate not in BIT_RATES:
            raise ValueError(f"{text!r} is not a bit rate; bit rates are {BIT_RATES[0]}…{BIT_RATES[-1]} bit/s")
        return rate


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
