"""An SDO frame, bit by bit (CiA 301, 7.2.4.3). Does not know which frames came before it."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from dvtcli.domain.abort import abort_text
from dvtcli.watch.explain.parts import Bytes, FramePart

#: what an object is called, and what its value says, by index, sub-index and its bytes (None: none is carried)
NameOf = Callable[[int, int, bytes | None], tuple[str, str]]

_SDO_BYTES = 8
_REQUESTS = {
    0: "download segment", 1: "initiate download", 2: "initiate upload", 3: "upload segment", 4: "abort transfer",
    5: "block upload", 6: "block download",
}  # fmt: skip
_ANSWERS = {
    0: "upload segment", 1: "download segment taken", 2: "initiate upload", 3: "download taken",
    4: "abort transfer", 5: "block download", 6: "block upload",
}  # fmt: skip
#: subcommands of the block transfers, by direction, command specifier and number
_BLOCK = {
    (True, 5): ("initiate", "end", "blocks' answer", "start"),
    (True, 6): ("initiate", "end"),
    (False, 5): ("initiate", "end", "blocks' answer"),
    (False, 6): ("initiate", "end"),
}


def sdo_parts(data: bytes, *, request: bool, name_of: NameOf) -> Iterator[FramePart]:
    """The parts of an SDO *request*, or of an answer."""
    cut = Bytes(data)
    if len(data) < _SDO_BYTES:
        yield from cut.rest(0, "too short: an SDO has 8 bytes")
        return
    command = data[0] >> 5
    words = (_REQUESTS if request else _ANSWERS).get(command, "unknown command specifier")
    yield cut.part(5, 3, "client command specifier" if request else "server command specifier", words)
    if command == 4:
        yield from _abort(cut, name_of)
    elif command in (5, 6):
        yield from _block(cut, command, request=request, name_of=name_of)
    elif (request and command == 1) or (not request and command == 2):
        yield from _initiate(cut, name_of)
    elif (request and command == 2) or (not request and command == 3):
        yield cut.part(0, 5, "reserved")
        yield from _object(cut, name_of)
        yield from cut.rest(4, "reserved")
    elif command == 0:
        yield from _segment(cut)
    elif command in (1, 3):
        yield cut.part(4, 1, "toggle bit")
        yield cut.part(0, 4, "reserved")
        yield from cut.rest(1, "reserved")
    else:
        yield cut.part(0, 5, "not known")
        yield from cut.rest(1, "not known")


def _object(cut: Bytes, name_of: NameOf, data: bytes | None = None) -> Iterator[FramePart]:
    index, sub_index = cut.number(1, 2), cut.data[3]
    name, _ = name_of(index, sub_index, data)
    yield cut.part(8, 16, "index", f"0x{index:04X}")
    yield cut.part(24, 8, "sub-index", name, f"{index:04X}:{sub_index:02X}")


def _abort(cut: Bytes, name_of: NameOf) -> Iterator[FramePart]:
    yield cut.part(0, 5, "reserved")
    yield from _object(cut, name_of)
    yield cut.part(32, 32, "abort code", abort_text(cut.number(4, 4)))


def _initiate(cut: Bytes, name_of: NameOf) -> Iterator[FramePart]:
    """A transfer's first frame that has data with it, or says how much there will be."""
    expedited, sized = cut.raw(1, 1), cut.raw(0, 1)
    yield cut.part(4, 1, "reserved")
    unused = cut.raw(2, 2) if expedited and sized else 0
    yield cut.part(2, 2, "n: bytes without data", str(unused) if expedited and sized else "not used")
    yield cut.part(1, 1, "e: transfer type", "expedited" if expedited else "in segments")
    yield cut.part(0, 1, "s: size", "indicated" if sized else "not indicated")
    if not expedited:
        yield from _object(cut, name_of)
        length = cut.number(4, 4)
        yield cut.part(32, 32, "size", f"{length} bytes follow" if sized else "not used")
        return
    data = cut.data[4 : _SDO_BYTES - unused]
    yield from _object(cut, name_of, data)
    _, value = name_of(cut.number(1, 2), cut.data[3], data)
    yield cut.part(32, 8 * len(data), "data", value)
    yield from cut.rest(_SDO_BYTES - unused, "without data")


def _segment(cut: Bytes) -> Iterator[FramePart]:
    unused = cut.raw(1, 3)
    yield cut.part(4, 1, "toggle bit")
    yield cut.part(1, 3, "n: bytes without data", str(unused))
    yield cut.part(0, 1, "c", "the last segment" if cut.raw(0, 1) else "more segments follow")
    end = _SDO_BYTES - unused
    if end > 1:
        yield cut.part(8, 8 * (end - 1), "data of the segment", _readable(cut.data[1:end]))
    yield from cut.rest(max(end, 1), "without data")


def _readable(data: bytes) -> str:
    """Bytes as text where all of them are letters, signs or blanks."""
    return repr(data.decode("ascii")) if data and all(0x20 <= byte < 0x7F for byte in data) else ""


def _block(cut: Bytes, command: int, *, request: bool, name_of: NameOf) -> Iterator[FramePart]:
    names = _BLOCK[request, command]
    width = 2 if len(names) > 2 else 1
    number = cut.raw(0, width)
    step = names[number] if number < len(names) else "unknown"
    sends = command == 6  # the side that has the data: it says sizes and checksums
    if step == "initiate":
        yield cut.part(3, 2, "reserved")
        yield cut.part(2, 1, "CRC", "supported" if cut.raw(2, 1) else "not supported")
        if sends:
            yield cut.part(1, 1, "s: size", "indicated" if cut.raw(1, 1) else "not indicated")
    elif step == "end" and sends:
        yield cut.part(2, 3, "n: bytes of the last segment without data", str(cut.raw(2, 3)))
        yield cut.part(1, 1, "reserved")
    else:
        yield cut.part(width, 5 - width, "reserved")
    yield cut.part(0, width, "subcommand", step)
    yield from _block_rest(cut, step, sends=sends, request=request, name_of=name_of)


def _block_rest(cut: Bytes, step: str, *, sends: bool, request: bool, name_of: NameOf) -> Iterator[FramePart]:
    if step == "initiate":
        yield from _object(cut, name_of)
        if sends:
            yield cut.part(32, 32, "size", f"{cut.number(4, 4)} bytes" if cut.raw(1, 1) else "not used")
            return
        yield cut.part(32, 8, "block size", f"{cut.data[4]} segments")
        if request:
            yield cut.part(40, 8, "protocol switch threshold", f"{cut.data[5]} bytes")
        yield from cut.rest(6 if request else 5, "reserved")
    elif step == "end" and sends:
        yield cut.part(8, 16, "CRC")
        yield from cut.rest(3, "reserved")
    elif step == "blocks' answer":
        yield cut.part(8, 8, "last segment taken in order", str(cut.data[1]))
        yield cut.part(16, 8, "block size of the next", f"{cut.data[2]} segments")
        yield from cut.rest(3, "reserved")
    else:
        yield from cut.rest(1, "reserved")
