"""What one concise DCF (CiA 302-3, 0x1F22) leaves otherwise in a node than another one, object by object. Pure."""

from __future__ import annotations

from collections.abc import Iterator

from dvtcli.domain.network.concise_dcf import read_concise_dcf
from dvtcli.domain.network.network_state import CONCISE_DCF
from dvtcli.domain.plan import Step

#: so many objects are told one by one
_MOST = 12
_SAME = "the same values, downloaded in another order or in other steps"


def download_lines(place: str, before: bytes | None, after: bytes | None) -> Iterator[str]:
    """Of the object *place*, as it is printed: how what a manager downloads *after* differs from *before*, in lines.

    None where it holds no download, or either side is none.
    """
    if place[:4] != f"{CONCISE_DCF:04X}" or before is None or after is None or before == after:
        return
    try:
        was, will = (read_concise_dcf(data) if data else {} for data in (before, after))
    except ValueError:
        return
    lines = [
        f"{_step(*at).object}  {_text(at, was)} -> {_text(at, will)}"
        for at in sorted({*was, *will})
        if was.get(at) != will.get(at)
    ]
    node = f"node {int(place[5:], 16)}"
    yield from (f"{node}  {line}" for line in (lines or [_SAME])[:_MOST])
    if len(lines) > _MOST:
        yield f"{node}  and {len(lines) - _MOST} more objects"


def _step(index: int, sub_index: int) -> Step:
    return Step(index, sub_index, None, b"", "")


def _text(at: tuple[int, int], values: dict[tuple[int, int], bytes]) -> str:
    return _step(*at).text(values[at]) if at in values else "not downloaded"
