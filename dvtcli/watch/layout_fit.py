"""Check whether a frame's length fits its layout, and whether the layout is certain for its sender."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

from dvtcli.domain.ports import Frame
from dvtcli.domain.text import plural
from dvtcli.watch.decoder import Address, Layout


def guess(frame: Frame, layout: Layout) -> str:
    """Note for a *frame* with values by a guessed *layout*, in words; empty otherwise."""
    return f"{_cob_id(frame)}: {layout.guess}" if layout.guess and layout.signals and not frame.remote else ""


def _cob_id(frame: Frame) -> str:
    return f"0x{frame.can_id:0{8 if frame.extended else 3}X}"


def doubts(frame: Frame, layout: Layout) -> list[str]:
    """Reasons to doubt values of *frame* by *layout*, in words: a guess, or a misfit."""
    return [text for text in (guess(frame, layout), misfit(frame, layout)) if text]


def misfit(frame: Frame, layout: Layout) -> str:
    """Mismatch between the lengths of *frame* and *layout*, in words; empty if they fit.

    A TPDO is sent as long as it is mapped. A node takes the front of a frame longer than its RPDO, and nothing
    of a shorter frame (CiA 301, 7.4.7).
    """
    length, mapped = len(frame.data), layout.byte_length
    if frame.remote or mapped is None or not layout.signals or length == mapped:
        return ""
    if layout.is_consumers and length > mapped:
        return ""
    who = f"{layout.service.label} of node {layout.service.node}" if layout.service.node else layout.service.label
    by = layout.source or "its mapping"
    said = f"{_cob_id(frame)}: the frame has {plural(length, 'byte')}, {by} has {mapped} for {who}"
    if layout.is_consumers:
        return f"{said}: a node ignores frames shorter than its RPDO, or this is not its mapping"
    return f"{said}: this is not the producer's layout, so the values shown may be wrong"


class Misfits:
    """Reports frames to *tell* if *layout_of* is a guess or does not fit, each once for each CAN-ID."""

    def __init__(self, layout_of: Callable[[Frame], Layout], tell: Callable[[str], None]) -> None:
        self._layout_of = layout_of
        self._tell = tell
        #: the last checked length, by address; None after a report
        self._seen: dict[Address, int | None] = {}

    def look(self, frame: Frame) -> None:
        """Check *frame*; cheap if its length is unchanged."""
        address, length = (frame.can_id, frame.extended), len(frame.data)
        seen = self._seen.get(address, -1)
        if seen == length or seen is None or frame.remote:
            return
        layout = self._layout_of(frame)
        if seen == -1 and (guessed := guess(frame, layout)):
            self._tell(guessed)
        text = misfit(frame, layout)
        self._seen[address] = None if text else length
        if text:
            self._tell(text)

    def passing(self, frames: Iterable[Frame]) -> Iterator[Frame]:
        """Yield *frames* after a check of each."""
        for frame in frames:
            self.look(frame)
            yield frame
