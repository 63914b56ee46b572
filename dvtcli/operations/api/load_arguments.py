"""What a program asks of `load`, checked. Opens nothing."""

from __future__ import annotations

from collections.abc import Mapping

from dvtcli.domain.milliseconds import counts
from dvtcli.domain.pdo import Pdo
from dvtcli.operations.api.checks import number, whole, wrong
from dvtcli.operations.network.network_load import LoadOptions
from dvtcli.operations.user.options import BIT_RATES

_END = "a TPDO of a node, such as '5:tpdo3' or 'drive:tpdo3', and its inhibit time in ms"


def load_wishes(
    for_s: float, bit_rate: int | None, sync_ms: float | None, inhibit_ms: Mapping[str, float] | None
) -> LoadOptions:
    """The arguments of `Bus.load`, as the operation takes them; UsageError for a wrong one."""
    number("for_s", for_s, "a number of seconds, 0…3600", high=3600)
    if bit_rate is not None:
        whole("bit_rate", bit_rate, "a bit rate (bit/s)", BIT_RATES[-1], low=BIT_RATES[0])
    if sync_ms is not None:
        number("sync_ms", sync_ms, "a number of milliseconds, 0…100000", high=100_000)
    if not isinstance(inhibit_ms, Mapping | None):
        raise wrong("inhibit_ms", inhibit_ms, _END)
    inhibit = dict(_inhibit(end, time) for end, time in (inhibit_ms or {}).items())
    return LoadOptions(for_s, bit_rate, sync_ms or None, None, inhibit)


def _inhibit(end: str, time_ms: float) -> tuple[tuple[int | str | None, Pdo], int]:
    node, colon, name = str(end).rpartition(":")
    is_number = not colon or node[:1].isdigit() or not node
    try:
        pdo = Pdo.parse(name)
        node_id = int(node) if colon and is_number else None
        if not pdo.is_tpdo or (node_id is not None and not 1 <= node_id <= 127):
            raise ValueError(end)
        return (node_id if is_number else node, pdo), counts(time_ms, 100, 0xFFFF)
    except (ValueError, TypeError) as unfit:
        raise wrong("inhibit_ms", {end: time_ms}, _END) from unfit
