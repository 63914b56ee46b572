"""Check the arguments of `check`. Opens nothing."""

from __future__ import annotations

from collections.abc import Sequence

from dvtcli.operations.api.checks import flags, number, whole, words
from dvtcli.operations.network.check_networks import CheckOptions
from dvtcli.operations.user.options import BIT_RATES


def check_wishes(
    rules: Sequence[str], without: Sequence[str], bit_rate: int | None, for_s: float | None, *, strict: bool
) -> CheckOptions:
    """Convert the arguments of `Bus.check`; raises UsageError if invalid."""
    flags(strict=strict)
    if bit_rate is not None:
        whole("bit_rate", bit_rate, "a bit rate (bit/s)", BIT_RATES[-1], low=BIT_RATES[0])
    if for_s is not None:
        number("for_s", for_s, "a number of seconds, 0…3600", high=3600)
    return CheckOptions(
        words("rules", rules), words("without", without), strict, bit_rate, as_findings=True, for_s=for_s
    )
