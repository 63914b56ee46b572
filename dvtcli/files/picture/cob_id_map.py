"""The 2048 CAN-IDs of 11 bits as a drawing: a row for each function code, a place for each node-ID. Reads nothing."""

from __future__ import annotations

from dvtcli.domain.network.picture import NetworkPicture, PictureFrame
from dvtcli.domain.several import plural
from dvtcli.files.picture.picture_words import cob_id, ends_text
from dvtcli.files.picture.svg import Element, add, drawing

_ROWS = (
    "NMT", "SYNC, EMCY", "TIME", "TPDO1", "RPDO1", "TPDO2", "RPDO2", "TPDO3", "RPDO3", "TPDO4", "RPDO4", "SDO answer",
    "SDO request", "-", "heartbeat", "LSS",
)  # fmt: skip
_ROW, _TOP = 17, 26
#: what the legend tells apart
_KINDS = ("unsent", "used", "late")
_MARKS = (1, 32, 64, 96, 127)


def cob_id_map(picture: NetworkPicture, width: int = 960, name: str = "map") -> Element:
    """The drawing, *width* wide; its ids begin with *name*."""
    frames = [frame for frame in picture.frames if not frame.identifier[1]]
    used = plural(len({frame.identifier for frame in frames}), "CAN-ID")
    title = f"Map of the CAN-IDs: {used} used; its table is below"
    root = drawing(width, _TOP + _ROW * len(_ROWS) + 4, name, title)
    left = 150 if width > 600 else 92
    step = (width - left - 8) / 128
    for node_id in _MARKS:
        add(root, "text", str(node_id), x=left + step * (node_id + 0.5), y=14, class_="tick", text_anchor="middle")
    for number, words in enumerate(_ROWS):
        y = _TOP + _ROW * number
        add(root, "text", f"0x{number << 7:03X}", x=4, y=y + 11, class_="id small")
        if width > 600:
            add(root, "text", words, x=48, y=y + 11, class_="dim small")
        else:
            add(root, "text", words.partition(",")[0].removesuffix(" answer").removesuffix(" request"), x=42, y=y + 11,
                class_="dim tiny")  # fmt: skip
        add(root, "rect", x=left, y=y, width=step * 128, height=_ROW - 3, rx=2, class_="lane")
    for frame in sorted(frames, key=lambda drawn: _KINDS.index(_kind(drawn))):  # what is worst is drawn over the others
        _place(root, frame, left, step)
    return root


def _place(root: Element, frame: PictureFrame, left: float, step: float) -> None:
    can_id = frame.identifier[0]
    x, y = left + step * (can_id & 0x7F), _TOP + _ROW * (can_id >> 7)
    wide = max(step - 0.6, 4)
    mark = add(root, "rect", x=f"{x + (step - wide) / 2:.2f}", y=y, width=f"{wide:.2f}", height=_ROW - 3, rx=1,
               class_=f"place {_kind(frame)}")  # fmt: skip
    whose = "" if frame.node is None else f" of node {frame.node}"
    hears = f", heard by {ends_text(frame.consumers)}" if frame.consumers else ""
    add(mark, "title", f"{cob_id(frame.identifier)} {frame.what or frame.why}{whose}{hears}{_warning(frame)}")


def _kind(frame: PictureFrame) -> str:
    """Which of the legend's colours it has."""
    return "late" if frame.is_late or frame.has_no_limit else "used" if frame.is_computed else "unsent"


def _warning(frame: PictureFrame) -> str:
    return ", no limit" if frame.has_no_limit else ", may be late" if frame.is_late else ""
