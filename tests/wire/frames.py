"""Frames as a golden file has them: SDO transfers in one word each where one frame holds all of it. Knows no time."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby

from dvtcli.domain.ports import Frame

#: How long a line of a golden file is.
_WIDTH = 116
#: Stands for a space at which no line ends.
_KEPT = "\0"
_DOWNLOAD, _UPLOAD, _WRITTEN = 1, 2, 3
_TO_NODE, _FROM_NODE = 0x600, 0x580


def node_of(frame: Frame) -> int:
    """Whose SDO, heartbeat or EMCY *frame* is; 0 for what concerns all nodes, or none."""
    function, node_id = frame.can_id & ~0x7F, frame.can_id & 0x7F
    return node_id if function in (_TO_NODE, _FROM_NODE, 0x080, 0x700) and not frame.extended else 0


def by_node(frames: Sequence[tuple[Frame, bool]]) -> Iterator[str]:
    """*frames*, each with whether we sent it, node by node in their order, and the order of writes of several nodes."""
    nodes = sorted({node_of(frame) for frame, _ in frames})
    for node_id in nodes:
        words = _words(_without_repeats(frame for frame, _ in frames if node_of(frame) == node_id))
        for _, group in groupby(words, _object):  # a line for each object: a frame more changes one line
            text = "; ".join(word.replace(" ", _KEPT) for word in group)
            lines = textwrap.wrap(
                text, _WIDTH, initial_indent=f"  {node_id or '-'} ", subsequent_indent="    ",
                break_long_words=False, break_on_hyphens=False,
            )  # fmt: skip
            yield from (line.replace(_KEPT, " ") for line in lines)
    if len(nodes) > 1 and (order := _order(frames)):
        yield from textwrap.wrap(
            "writes in order: " + " ".join(order), _WIDTH, initial_indent="  ", subsequent_indent="    "
        )


def _object(word: str) -> str:
    """What the frames of one line have in common: what is done, and to which object."""
    return word.partition(":")[0] if word[1] == " " else ""


def _without_repeats(frames: Iterable[Frame]) -> list[Frame]:
    """*frames* of one node without heartbeats of the NMT state that the one before had: how many come is time."""
    found: list[Frame] = []
    state: bytes | None = None
    for frame in frames:
        if frame.can_id & ~0x7F == 0x700:
            if frame.data == state:
                continue
            state = bytes(frame.data)
        found.append(frame)
    return found


def _order(frames: Iterable[tuple[Frame, bool]]) -> list[str]:
    """Which node each download went to, one behind the other; equal neighbours are counted."""
    found: list[list[int]] = []
    for frame, sent in frames:
        if sent and frame.can_id & ~0x7F == _TO_NODE and frame.data[0] >> 5 == _DOWNLOAD:
            node_id = frame.can_id & 0x7F
            if found and found[-1][0] == node_id:
                found[-1][1] += 1
            else:
                found.append([node_id, 1])
    return [f"{node_id}x{count}" for node_id, count in found] if len(found) > 1 else []


def _words(frames: Sequence[Frame]) -> Iterator[str]:
    """`r INDEX:SUB DATA`, `w INDEX:SUB DATA`: a transfer of one request and one answer; other frames as they are."""
    at = 0
    while at < len(frames):
        answer = frames[at + 1] if at + 1 < len(frames) else None
        word = _transfer(frames[at], answer) if answer is not None else None
        yield word or _plain(frames[at])
        at += 2 if word else 1


def _transfer(request: Frame, answer: Frame) -> str | None:
    """The word of an expedited transfer, None if *request* and *answer* are none."""
    if (
        request.can_id & ~0x7F != _TO_NODE
        or answer.can_id & ~0x7F != _FROM_NODE
        or request.data[1:4] != answer.data[1:4]
    ):
        return None
    place = f"{request.data[2]:02X}{request.data[1]:02X}:{request.data[3]:X}"
    what, said = request.data[0] >> 5, answer.data[0]
    if what == _DOWNLOAD and request.data[0] & 3 == 3:
        written = request.data[4 : 8 - (request.data[0] >> 2 & 3)].hex().upper()
        if said == 0x60:
            return f"w {place} {written}"
        return f"w {place} {written} abort {_code(answer)}" if said == 0x80 else None
    if what == _UPLOAD and said == 0x80:
        return f"r {place} abort {_code(answer)}"
    if what == _UPLOAD and said >> 5 == _UPLOAD and said & 3 == 3:
        return f"r {place} {answer.data[4 : 8 - (said >> 2 & 3)].hex().upper()}"
    return None


def _code(answer: Frame) -> str:
    return f"{int.from_bytes(answer.data[4:8], 'little'):08X}"


def _plain(frame: Frame) -> str:
    return f"{frame.can_id:03X}#{frame.data.hex().upper()}"
