"""The frames of a picture, each with who hears it and what it needs of the bus. Computes nothing, reads no node."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from typing import TYPE_CHECKING

from dvtcli.domain.network.network_state import identifier_of
from dvtcli.domain.network.picture import PictureFrame, PictureLoad
from dvtcli.domain.network.wanted_state import Endpoint

if TYPE_CHECKING:
    from dvtcli.domain.network.bus_need import StreamNeed
    from dvtcli.domain.network.network_state import Identifier, NetworkState
    from dvtcli.operations.results.loads import FrameLoad, NetworkLoad


def drawn_load(load: NetworkLoad) -> PictureLoad:
    """What all frames need together, and what was measured."""
    need, measured = load.need, load.measured
    heard = measured.load(need.bit_rate) if measured is not None and measured.seconds else None
    return PictureLoad(
        need.bit_rate, need.limited, need.total, need.fits, load.is_assumed, load.fitting, need.assumed, heard,
        0.0 if measured is None else measured.seconds,
    )  # fmt: skip


def drawn_frames(state: NetworkState, load: NetworkLoad) -> Iterator[PictureFrame]:
    """Every CAN-ID that is used: what is sent with it as `load` computes it, and what RPDOs only wait for."""
    hearing = _hearing(state)
    found: dict[tuple[Identifier, int], PictureFrame] = {}
    for frame_load in load.frames:
        for number, need in enumerate(frame_load.needs or (None,)):
            found[frame_load.identifier, number] = _frame(
                load, frame_load, need, hearing.get(frame_load.identifier, ())
            )
    used = {identifier for identifier, _ in found}
    for node, pdo, config in state.enabled(is_tpdo=True):
        if (identifier := identifier_of(config)) not in used:
            frame = PictureFrame(identifier, pdo.label, node.node_id, (config.bits + 7) // 8, "on request (RTR)",
                                 is_computed=False, consumers=hearing.get(identifier, ()))  # fmt: skip
            found.setdefault((identifier, 0), frame)
    used = {identifier for identifier, _ in found}
    for identifier in hearing.keys() - used:
        why = "nobody here sends it"
        found[identifier, 0] = PictureFrame(
            identifier, "", None, 0, why, is_computed=False, consumers=hearing[identifier]
        )
    yield from (found[key] for key in sorted(found, key=_order))


def _order(key: tuple[Identifier, int]) -> tuple[int, bool, int, int]:
    """The order of the wire: the lower CAN-ID goes first."""
    (can_id, extended), number = key
    return (can_id >> 18 if extended else can_id, extended, can_id, number)


def _hearing(state: NetworkState) -> dict[Identifier, tuple[Endpoint, ...]]:
    """The enabled RPDOs by what they hear."""
    found: dict[Identifier, tuple[Endpoint, ...]] = {}
    for node, pdo, config in state.enabled(is_tpdo=False):
        identifier = identifier_of(config)
        found[identifier] = (*found.get(identifier, ()), Endpoint(node.node_id, pdo))
    return found


def _frame(load: NetworkLoad, one: FrameLoad, need: StreamNeed | None, consumers: tuple[Endpoint, ...]) -> PictureFrame:
    measured = load.measured if load.measured is not None and load.measured.seconds else None
    heard_hz = measured.rate_hz(one.identifier) if measured else None
    heard_share = measured.share(one.identifier, load.need.bit_rate) if measured else None
    if need is None:
        length = one.heard.data_bytes if one.heard else 0
        return PictureFrame(
            one.identifier, one.label, one.node, length, "only heard", is_computed=False, consumers=consumers,
            heard_hz=heard_hz, heard_share=heard_share,
        )  # fmt: skip
    stream = need.stream
    hears = tuple(end for end in consumers if end.node_id != stream.node)
    return PictureFrame(
        one.identifier, stream.label, stream.node, stream.frame.data_bytes, stream.why,
        _fraction(stream.frame.period_us), need.share, need.response_us, _fraction(stream.deadline_us), need.is_late,
        True, hears, heard_hz, heard_share,
    )  # fmt: skip


def _fraction(time_us: Fraction | int | None) -> Fraction | None:
    return None if time_us is None else Fraction(time_us)
