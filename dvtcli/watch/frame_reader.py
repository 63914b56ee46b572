"""Frames in words: what each frame of CANopen's services says, one after the other.

`explain`, `decode`, `monitor`, `log`, `trace`, `send` and `replay` take their words from here; `service_words` has
those that a frame's parts have, too.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import NamedTuple

from dvtcli.domain.abort import abort_text
from dvtcli.domain.datatypes import Value
from dvtcli.domain.emergency_codes import emergency_text
from dvtcli.domain.objects import SDO_SERVERS
from dvtcli.domain.ports import Frame
from dvtcli.domain.text import plural
from dvtcli.watch.decoder import Address, Decoder, Layout, server_layouts
from dvtcli.watch.frame_parts import lss_parts
from dvtcli.watch.known_node import KnownNode, of_mpdo
from dvtcli.watch.sdo_transfers import SdoStep, SdoTransfers
from dvtcli.watch.service import Service
from dvtcli.watch.service_words import (
    SDO_BYTES,
    addressee,
    command_word,
    sdo_command,
    state_word,
    time_of_day,
    wrong_counter,
    wrong_length,
)

#: facts of a frame by name, for machines
Facts = Mapping[str, Value | None]
_NO_FACTS: Facts = {}
_DESTINATION = 0x80
#: kinds that are part of another one
_PARTS = {"mpdo": "pdo", "sdo-abort": "sdo", "boot-up": "heartbeat"}


class Reading(NamedTuple):
    """What a frame is, one of `typed_frame.READ_KINDS`; its *text*, empty for a PDO; and its *facts* by name."""

    what: str
    text: str = ""
    facts: Facts = _NO_FACTS

    def is_one_of(self, kinds: frozenset[str]) -> bool:
        """Whether the frame is of one of *kinds*; `sdo` has aborts, `pdo` MPDOs, `heartbeat` boot-ups."""
        return self.what in kinds or _PARTS.get(self.what) in kinds


_PDO, OTHER, _SYNC = Reading("pdo"), Reading("other"), Reading("sync", "SYNC")
_Read = Callable[[Frame], Reading]


class FrameReader:
    """Read the frames of one bus in their order; *described* returns what is known of a node, by node-ID."""

    def __init__(self, decoder: Decoder, described: Callable[[int], KnownNode]) -> None:
        self.decoder = decoder
        self.described = described
        self._transfers = SdoTransfers()
        #: SDO servers whose COB-IDs a transfer had
        self._servers: dict[Address, Layout] = {}
        #: nodes that were asked for their state: what they send next is no heartbeat
        self._guarded: set[int | None] = set()
        self._by_address: dict[Address, _Read] = {}
        self._by_kind: dict[str, Callable[[Service, Frame], Reading]] = {
            "nmt": _nmt, "sync": _sync, "time": _time, "emcy": self._emergency, "heartbeat": self._heartbeat,
            "sdo": self._sdo, "lss": _lss,
        }  # fmt: skip

    def know(self, decoder: Decoder) -> None:
        """Use *decoder* from now on; running transfers, and SDO servers that were seen, stay."""
        decoder.add(self._servers)
        self.decoder = decoder
        self._by_address.clear()

    def read(self, frame: Frame) -> Reading:
        """Return what *frame* says, the next frame on the bus."""
        address = frame.can_id, frame.extended
        read = self._by_address.get(address)
        if read is None:
            read = self._by_address[address] = self._reader_of(self.decoder.layout(frame))
        return read(frame)

    def _reader_of(self, layout: Layout) -> _Read:
        service = layout.service
        read = self._by_kind.get(service.kind)
        if layout.mpdo is not None:
            return lambda frame: _asked(_PDO) if frame.remote else self._mpdo(service, frame.data)
        if read is None:
            reading = _PDO if service.kind == "pdo" else OTHER
            return lambda frame: _asked(reading) if frame.remote else reading
        if service.kind == "heartbeat":
            return lambda frame: read(service, frame)
        return lambda frame: _asked(Reading(service.kind)) if frame.remote else read(service, frame)

    def _heartbeat(self, service: Service, frame: Frame) -> Reading:
        if frame.remote:
            self._guarded.add(service.node)
            return Reading("guarding", "node guarding request")
        if not frame.data:
            return Reading("heartbeat", wrong_length("heartbeat", 0))
        is_answer = service.node in self._guarded
        if is_answer:
            self._guarded.discard(service.node)
        if frame.data == b"\0":
            self._transfers.drop(service.node)
        reading = _state(frame.data[0], is_boot_up=frame.data == b"\0", is_answer=is_answer)
        return reading if len(frame.data) == 1 else _noted(reading, wrong_length("heartbeat", len(frame.data)))

    def _emergency(self, service: Service, frame: Frame) -> Reading:
        data = frame.data
        if len(data) < 2:
            return Reading("emcy", "EMCY too short: it has 8 bytes")
        code = int.from_bytes(data[:2], "little")
        device_type = self.described(service.node or 0).device_type
        text = f"EMCY 0x{code:04X} {emergency_text(code, device_type)}"
        facts: dict[str, Value | None] = {"code": code, "meaning": emergency_text(code, device_type)}
        if len(data) > 2:
            facts["register"] = data[2]
            text += f", register 0x{data[2]:02X}"
        if any(data[3:]):
            facts["data"] = data[3:]
            text += f", data {data[3:].hex(' ').upper()}"
        return Reading("emcy", text, facts)

    def _mpdo(self, service: Service, data: bytes) -> Reading:
        """Multiplexed PDO: node, object and value (CiA 301, 7.2.2.6)."""
        if len(data) < SDO_BYTES:
            return Reading("mpdo", wrong_length("mpdo", len(data)))
        node, is_destination = data[0] & 0x7F, bool(data[0] & _DESTINATION)
        index, sub_index = int.from_bytes(data[1:3], "little"), data[3]
        of = of_mpdo(self.described, node, service.node)
        name, text, value = of.value(index, sub_index, data[4:8], padded=True)
        place = f"{index:04X}:{sub_index:02X}"
        who = ("to " if is_destination else "from ") + (f"node {node}" if node else "all nodes")
        return Reading(
            "mpdo", f"{who}: {_named(place, name)} = {text}",
            {"to" if is_destination else "from": node, "object": place, "name": name, "value": value},
        )  # fmt: skip

    def _sdo(self, service: Service, frame: Frame) -> Reading:
        request = service.label.endswith("request")
        step = self._transfers.take(_channel(service), frame.data, request=request)
        if step.place is None:
            return Reading("sdo", wrong_length("sdo", len(frame.data)) or _unknown(frame.data, request=request))
        if step.step == "done" and step.place[0] in SDO_SERVERS and service.node is not None:
            self._know_server(service.node, step.place, step.data)
        has_value = step.step == "done" or (step.step == "start" and step.data)
        data = step.data if has_value and step.data else None
        known = self.described(service.node or 0).value(*step.place, data, padded=step.is_padded)
        text, value = known.text, known.value
        if step.size is not None and len(step.data) < step.size and has_value:
            text, value = f"{plural(step.size, 'byte')}, beginning with {text}", None
        named = _named(step.object, known.name)
        facts: dict[str, Value | None] = {
            "transfer": None if step.is_write is None else "write" if step.is_write else "read", "step": step.step,
            "object": step.object, "name": known.name,
        }  # fmt: skip
        if step.step == "abort":
            facts |= {"abort_code": step.code, "meaning": abort_text(step.code)}
            return Reading("sdo-abort", f"abort 0x{step.code:08X} of {named}: {abort_text(step.code)}", facts)
        if has_value and (step.data or step.size is not None):
            facts |= {"value": value, "bytes": step.size if step.size is not None else len(step.data)}
        return Reading("sdo", _sdo_text(step, named, text), facts)

    def _know_server(self, node_id: int, place: tuple[int, int], data: bytes) -> None:
        """Read the frames of a further SDO server from now on: *data* is its COB-ID."""
        found = server_layouts(node_id, {place: int.from_bytes(data, "little")})
        self._servers |= found
        self.decoder.add(found)
        for address in found:
            self._by_address.pop(address, None)


def _asked(reading: Reading) -> Reading:
    return reading._replace(text="remote request")


def _channel(service: Service) -> tuple[int | None, str]:
    """The pair of CAN-IDs of a client and a server: `SDO request` and `SDO answer` of a node, or `SDO2 …`."""
    return service.node, service.label.partition(" ")[0]


def _named(place: str, name: str) -> str:
    return f"{place} {name}" if name else place


def _sdo_text(step: SdoStep, named: str, value: str) -> str:
    """A frame of a transfer in words; *value* is the value's text."""
    way = "write" if step.is_write else "read"
    how = " by blocks" if step.way == "blocks" else ""
    size = "" if step.size is None else f", {plural(step.size, 'byte')}"
    if step.step == "start":
        return f"{way} {named} = {value}" if step.data else f"{way} {named}{how}{size}"
    if step.step == "accepted":
        return f"{way} {named}: accepted{how}{'' if step.is_write else size}"
    if step.step == "segment":
        of = "" if step.size is None else f" of {step.size}"
        return f"{way} {named}: bytes {step.position - len(step.data) + 1} to {_bytes_so_far(step)}{of}"
    if step.step == "next":
        taken = plural(_bytes_so_far(step), "byte")
        return f"{way} {named}: {taken} taken" if step.position else f"{way} {named}: go on"
    if step.step == "incomplete":
        return f"{way} {named}: {_misfit(step)}"
    if step.step == "end":
        return f"{way} {named}: end of blocks, {plural(step.position, 'byte')}"
    if not step.is_write:
        return f"{named} = {value or 'empty'}"
    return f"{named} written{f' = {value}' if step.way not in ('', 'expedited') else ''}"


def _bytes_so_far(step: SdoStep) -> int:
    """Bytes of the value so far, without those that fill the last segment of blocks."""
    if step.way == "blocks" and step.size is not None and 0 < step.position - step.size < SDO_BYTES - 1:
        return step.size
    return step.position


def _misfit(step: SdoStep) -> str:
    """What is wrong with a transfer that ended without its value."""
    if step.size is None:
        return f"incomplete: {plural(step.position, 'byte')}"
    how = "incomplete" if step.position < step.size else "segments do not fit"
    return f"{how}: {step.position} of {plural(step.size, 'byte')}"


def _unknown(data: bytes, *, request: bool) -> str:
    """A frame of a transfer whose beginning is missing."""
    word = sdo_command(data[0] >> 5, request=request)
    if word is None:
        return "unknown command specifier"
    return f"{word.removeprefix('initiate ').removesuffix(' transfer')} of an unknown object"


@lru_cache(maxsize=1024)
def _state(byte: int, *, is_boot_up: bool, is_answer: bool) -> Reading:
    """A heartbeat, a boot-up, or the answer of node guarding, which has a toggle bit."""
    toggle, words = byte >> 7, state_word(byte)
    if is_boot_up:
        return Reading("boot-up", "boot-up", {"state": words})
    if is_answer or toggle:
        return Reading("guarding", f"{words}, toggle bit {toggle}", {"state": words, "toggle": toggle})
    return Reading("heartbeat", words, {"state": words})


def _noted(reading: Reading, *doubts: str) -> Reading:
    """*reading*, followed by the *doubts* that are not empty."""
    return reading._replace(text="; ".join([reading.text, *filter(None, doubts)])) if any(doubts) else reading


#: commands whose name for machines is not the word for people
_NAMES = {"preop": "pre-operational", "reset-comm": "reset-communication"}


def _nmt(_service: Service, frame: Frame) -> Reading:
    data = frame.data
    if len(data) < 2:
        return Reading("nmt", "NMT too short: it has 2 bytes")
    word = command_word(data[0]) or f"reserved command 0x{data[0]:02X}"
    reading = Reading("nmt", f"NMT {word} -> {addressee(data[1])}", {"command": _NAMES.get(word, word), "to": data[1]})
    return _noted(reading, wrong_length("nmt", len(data)))


def _sync(_service: Service, frame: Frame) -> Reading:
    if not frame.data:
        return _SYNC
    counter = frame.data[0]
    reading = Reading("sync", f"SYNC {counter}", {"counter": counter})
    return _noted(reading, wrong_counter(counter), wrong_length("sync", len(frame.data)))


def _time(_service: Service, frame: Frame) -> Reading:
    data, wrong = frame.data, wrong_length("time", len(frame.data))
    if len(data) < 6:
        return Reading("time", "TIME too short: it has 6 bytes")
    milliseconds = int.from_bytes(data[:4], "little") & 0x0FFF_FFFF
    at = time_of_day(milliseconds, int.from_bytes(data[4:6], "little"))
    if at is None:
        return _noted(Reading("time", f"TIME {milliseconds} ms: more than a day has"), wrong)
    text = at.isoformat(" ", "milliseconds").removesuffix("+00:00")
    return _noted(Reading("time", f"TIME {text}", {"at": text}), wrong)


def _lss(service: Service, frame: Frame) -> Reading:
    parts = [part for part in lss_parts(frame.data, request=service.label == "LSS") if part.text]
    if not parts:
        return Reading("lss", "LSS without data")
    first, *others = parts
    named = [part.text if first.text.endswith(part.name) else f"{part.name} {part.text}" for part in others]
    text = f"LSS {first.text}{': ' if named else ''}{', '.join(named)}"
    return Reading("lss", text, {"command": first.raw, **{part.name: part.text for part in others}})
