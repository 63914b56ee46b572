"""A table of questions to a device, in the words of CiA 301, put by a raw SDO client; `learn` has no part in it.

Each question is a few SDO downloads on a device that has just booted; its answer is every abort code, and what the
last object holds after that.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from dvtcli.domain.nmt import NmtCommand
from dvtcli.domain.object_dictionary import ObjectDictionary
from dvtcli.simulator.device.strict_device import StrictDevice
from tests.simulator.bench import Aborted, Client

#: Index, sub-index, value, size in bytes.
Download = tuple[int, int, int, int]


@dataclass(frozen=True)
class Question:
    """*name* for people; *downloads* in order; *operational*: after the node was started."""

    name: str
    downloads: tuple[Download, ...]
    operational: bool = False


def put(device: StrictDevice, question: Question) -> list[str]:
    """What *device*, which has just booted, answers."""
    client = Client.on(device)
    if question.operational:
        device.nmt(NmtCommand.START)
    said = [_written(client, one) for one in question.downloads]
    index, sub_index, _, _ = question.downloads[-1]
    try:
        said.append(client.read(index, sub_index).hex())
    except Aborted as aborted:
        said.append(f"!{aborted.code:08X}")
    return said


def _written(client: Client, download: Download) -> str:
    try:
        client.write(*download)
    except Aborted as aborted:
        return f"{aborted.code:08X}"
    return "ok"


def questions(dictionary: ObjectDictionary, node_id: int = 1) -> list[Question]:
    """Every question that can be put to a device with this *dictionary*, both directions."""
    found: list[Question] = []
    for way, comm, mapping, accesses in (
        ("TPDO", 0x1800, 0x1A00, ("ro", "rwr", "const", "rw")),
        ("RPDO", 0x1400, 0x1600, ("wo", "rww", "rw")),
    ):
        for number in _dynamic(dictionary, comm, mapping):
            found += _about(dictionary, node_id, f"{way}{number + 1}", comm + number, mapping + number, accesses)
    return found


def _dynamic(dictionary: ObjectDictionary, comm: int, mapping: int) -> list[int]:
    """The first and the last PDO of a direction whose mapping and COB-ID can be written."""
    found = []
    for number in range(512):
        places = [(comm + number, 1), (mapping + number, 0), (mapping + number, 1)]
        entries = [dictionary.entry(*place) for place in places]
        if all(entry is not None and entry.access.writable for entry in entries):
            found.append(number)
    return sorted({found[0], found[-1]}) if found else []


def _mapped(dictionary: ObjectDictionary, accesses: tuple[str, ...]) -> dict[int, list[int]]:
    """Mapping entries by length, of objects that are marked as mappable and may go this way."""
    found: dict[int, list[int]] = {}
    for entry in dictionary.entries():
        if (
            entry.pdo_mapping
            and entry.access in accesses
            and entry.bits in (1, 8, 16, 32, 64)
            and entry.index >= 0x2000
        ):
            found.setdefault(entry.bits, []).append(entry.index << 16 | entry.sub_index << 8 | entry.bits)
    return found


def _about(
    dictionary: ObjectDictionary, node_id: int, label: str, comm: int, mapping: int, accesses: tuple[str, ...]
) -> Iterator[Question]:
    held = dictionary.entry(comm, 1)
    assert held is not None
    start = int.from_bytes(held.initial(node_id) or b"\0", "little")
    off = start | 1 << 31
    close: tuple[Download, ...] = ((comm, 1, off, 4), (mapping, 0, 0, 1))
    objects = _mapped(dictionary, accesses)
    words = [word for length in sorted(objects) for word in objects[length]]
    sizes: dict[int, int] = {}
    for sub in (2, 3, 5, 6):
        described = dictionary.entry(comm, sub)
        if described is not None and described.data_type is not None and described.data_type.size:
            sizes[sub] = described.data_type.size

    def ask(name: str, *downloads: Download, operational: bool = False) -> Question:
        return Question(f"{label} {name}", (*close, *downloads), operational)

    def entry(number: int, word: int) -> Download:
        return (mapping, number, word, 4)

    def count(number: int) -> Download:
        return (mapping, 0, number, 1)

    yield Question(f"{label} COB-ID as it is", ((comm, 1, start, 4),))
    for bit in (29, 30):
        yield ask(f"bit {bit} set", (comm, 1, off | 1 << bit, 4))
        yield ask(f"bit {bit} clear", (comm, 1, off & ~(1 << bit), 4))
    yield ask("another CAN-ID while off", (comm, 1, (off & 0xE0000000) | 0x6A5, 4))
    yield ask("enabled without a mapping", (comm, 1, (off & 0x40000000) | 0x6A5, 4))
    yield from _parameters(ask, comm, sizes)
    yield ask("sub 4", (comm, 4, 0, 1))
    yield from _entries(ask, dictionary, mapping)
    for length, some in sorted(objects.items()):
        yield ask(f"an object of {length} bits", entry(1, some[-1]), count(1))
    if words:
        yield from _with_objects(ask, comm, mapping, off, words, sizes)


def _parameters(ask: Callable[..., Question], comm: int, sizes: dict[int, int]) -> Iterator[Question]:
    for value in (0, 1, 5, 239, 240, 241, 245, 250, 251, 252, 253, 254, 255):
        if 2 in sizes:
            yield ask(f"type {value}", (comm, 2, value, 1))
    for sub, size in sizes.items():
        if sub != 2 and size:
            for value in (0, 1, 0x7FFF, 0x8000, 0xFFFF):
                if value < 1 << 8 * size:
                    yield ask(f"sub {sub} = {value}", (comm, sub, value, size))


def _entries(ask: Callable[..., Question], dictionary: ObjectDictionary, mapping: int) -> Iterator[Question]:
    def entry(number: int, word: int) -> Download:
        return (mapping, number, word, 4)

    yield ask("no such object", entry(1, 0x5FFE0010))
    yield ask("a dummy with sub 1", entry(1, 0x00050108))
    yield ask("entry of 0", entry(1, 0))
    yield ask("count over an entry of 0", entry(1, 0), (mapping, 0, 1, 1))
    for dummy, bits in ((1, 1), (2, 8), (3, 16), (4, 32), (5, 8), (6, 16), (7, 32)):
        yield ask(f"dummy {dummy}", entry(1, dummy << 16 | bits))
    for access in ("ro", "rw", "rwr", "rww", "wo", "const"):
        for word in next(iter(_mapped(dictionary, (access,)).values()), [])[-1:]:
            yield ask(f"a mappable {access} object", entry(1, word))
    for wrong in (0x10180120, 0x10000020, 0x10170010):
        if dictionary.entry(wrong >> 16, wrong >> 8 & 0xFF):
            yield ask(f"{wrong:08X}", entry(1, wrong))


def _with_objects(
    ask: Callable[..., Question], comm: int, mapping: int, off: int, words: list[int], sizes: dict[int, int]
) -> Iterator[Question]:
    first, longest = words[0], max(words, key=lambda word: word & 0xFF)
    bits = longest & 0xFF

    def entry(number: int, word: int) -> Download:
        return (mapping, number, word, 4)

    def count(number: int) -> Download:
        return (mapping, 0, number, 1)

    on = (comm, 1, (off & 0x40000000) | 0x6A5, 4)
    filled = (entry(1, first), count(1))
    yield ask("no such sub-index", entry(1, (first & 0xFFFF00FF) | 0xEE00))
    yield ask("too long an entry", entry(1, longest - bits + 2 * bits))
    for part in (0, 1, 2, 4, 8, 12, 24):
        if part < bits:
            yield ask(f"{part} of {bits} bits", entry(1, longest - bits + part), count(1))
    for number in (2, 3, 4, 5, 8, 9, 16, 33):
        yield ask(f"entry {number}", entry(number, first))
        many = [entry(one, first) for one in range(1, number + 1)]
        yield ask(f"{number} entries", *many, count(number))
        yield ask(f"count {number} over 1", entry(1, first), count(number))
    for number in (2, 3, 5):
        yield ask(f"{number} of {bits} bits", *(entry(one, longest) for one in range(1, number + 1)), count(number))
    yield ask("the entry again while counted", *filled, entry(1, first))
    yield ask("another entry while counted", *filled, entry(1, longest))
    yield ask("another count while counted", *filled, count(0))
    yield ask("enabled", *filled, on)
    for name, download in (
        ("the COB-ID again", on),
        ("another CAN-ID", (comm, 1, (off & 0x40000000) | 0x6A6, 4)),
        ("off, another CAN-ID", (comm, 1, off & 0xC0000000 | 0x6A7, 4)),
        ("the count again", count(1)),
        ("count 0", count(0)),
        ("the entry again", entry(1, first)),
        ("another entry", entry(1, longest)),
        *((f"sub {sub}", (comm, sub, 7 if sub != 2 else 254, size)) for sub, size in sizes.items()),
    ):
        yield ask(f"while enabled: {name}", *filled, on, download)
    for can_id in (0x000, 0x010, 0x07F, 0x101, 0x180, 0x581, 0x5FF, 0x601, 0x67F, 0x6E0, 0x6FF, 0x701, 0x7FF, 0x800):
        yield ask(f"enabled on 0x{can_id:03X}", *filled, (comm, 1, (off & 0x40000000) | can_id, 4))
