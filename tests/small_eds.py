"""EDS files as text, made in a few words for a test: a device that is right, and whatever else is asked."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

U8, U16, U32 = 0x0005, 0x0006, 0x0007
#: What may be mapped in every file, unless it says otherwise: 16 inputs for TPDOs, 16 outputs for RPDOs.
INPUTS, OUTPUTS = 0x6000, 0x6200
BYTES = 16


#: what stands in a section
Keys = dict[str, object]


@dataclass
class Section:
    """One section: its keys in order; an empty value is written as `Key=`."""

    name: str
    keys: Keys

    def __str__(self) -> str:
        return "\n".join([f"[{self.name}]", *(f"{key}={_text(value)}" for key, value in self.keys.items())])


def _text(value: object) -> str:
    return f"0x{value:X}" if isinstance(value, int) else str(value)


def var(name: str, kind: int, default: object = None, access: str = "rw", mapping: int = 0, **more: object) -> Keys:
    """The keys of a variable."""
    keys: Keys = {"ParameterName": name, "ObjectType": 7, "DataType": kind, "AccessType": access}
    if default is not None:
        keys["DefaultValue"] = default
    return {**keys, "PDOMapping": mapping, **more}


@dataclass
class Eds:
    """A file: *objects* index -> name and sub-index -> keys; a plain variable has sub-index None only."""

    objects: dict[int, tuple[str, dict[int | None, Keys]]] = field(default_factory=dict)
    info: Keys = field(default_factory=dict)
    dummies: Iterable[int] = (1, 2, 3, 4, 5, 6, 7)
    more: list[Section] = field(default_factory=list)

    def variable(self, index: int, keys: Keys) -> None:
        """Put a variable at *index*."""
        self.objects[index] = (str(keys["ParameterName"]), {None: keys})

    def record(self, index: int, name: str, subs: Mapping[int, Keys]) -> None:
        """Put a record at *index*; its sub-index 0 is made where it is not given."""
        highest = max(subs, default=0)
        parts: dict[int | None, Keys] = {0: var("Highest sub-index", U8, highest, "ro")}
        parts.update(subs.items())
        self.objects[index] = (name, parts)

    def text(self) -> str:
        """The file."""
        info = {"VendorName": "dvtcli tests", "VendorNumber": 0x0, "ProductName": "odd", "ProductNumber": 0x0}
        sections = [Section("FileInfo", {"FileName": "odd.eds"}), Section("DeviceInfo", {**info, **self.info})]
        usage: Keys = {f"Dummy{index:04X}": int(index in self.dummies) for index in range(1, 8)}
        sections.append(Section("DummyUsage", usage))
        for title, indices in self._lists():
            rows: Keys = {"SupportedObjects": str(len(indices))}
            sections.append(Section(title, rows | {str(n): f"0x{index:04X}" for n, index in enumerate(indices, 1)}))
        for index, (name, subs) in sorted(self.objects.items()):
            sections += _object(index, name, subs)
        return "\n\n".join(map(str, [*sections, *self.more])) + "\n"

    def _lists(self) -> list[tuple[str, list[int]]]:
        mandatory = (0x1000, 0x1001, 0x1018)
        found = sorted(self.objects)
        return [
            ("MandatoryObjects", [index for index in found if index in mandatory]),
            ("OptionalObjects", [i for i in found if i not in mandatory and not 0x2000 <= i < 0x6000]),
            ("ManufacturerObjects", [i for i in found if 0x2000 <= i < 0x6000]),
        ]


def _object(index: int, name: str, subs: dict[int | None, Keys]) -> list[Section]:
    if None in subs:
        return [Section(f"{index:04X}", subs[None])]
    head = Section(f"{index:04X}", {"ParameterName": name, "ObjectType": 9, "SubNumber": len(subs)})
    return [head, *(Section(f"{index:04X}sub{sub:X}", keys) for sub, keys in subs.items() if sub is not None)]


def communication(cob_id: object, kind: object = 255, **more: Keys) -> dict[int, Keys]:
    """Sub-indices 1, 2, 3 and 5 of a communication parameter; *more* replaces one: `sub5=…`."""
    subs = {
        1: var("COB-ID", U32, cob_id), 2: var("Transmission type", U8, kind),
        3: var("Inhibit time", U16, 0), 5: var("Event timer", U16, 0),
    }  # fmt: skip
    return subs | {int(key.removeprefix("sub"), 16): keys for key, keys in more.items()}


def mapping(count: object, entries: Iterable[object], access: str = "rw", sub_0: str = "rw") -> dict[int, Keys]:
    """A mapping parameter whose entries have those defaults."""
    subs = {0: var("Number of mapped objects", U8, count, sub_0)}
    return subs | {n: var(f"Entry {n}", U32, entry, access) for n, entry in enumerate(entries, 1)}


def plain(entries: int = 4) -> Eds:
    """A device that is right: TPDO1 and RPDO1 enabled with one object, the second ones off and empty."""
    eds = Eds()
    eds.variable(0x1000, var("Device type", U32, 0, "ro"))
    eds.variable(0x1001, var("Error register", U8, 0, "ro"))
    eds.variable(0x1017, var("Heartbeat time", U16, 0))
    eds.record(0x1010, "Store", {1: var("Save all", U32, 1)})
    eds.record(0x1018, "Identity", {n: var(f"Part {n}", U32, 0, "ro") for n in range(1, 5)})
    for base, index, default, objects in ((0x1400, 0x1600, 0x200, OUTPUTS), (0x1800, 0x1A00, 0x180, INPUTS)):
        for number in (0, 1):
            word = f"$NODEID+0x{default + 0x100 * number + (0x80000000 if number else 0):X}"
            eds.record(base + number, f"Communication {number + 1}", communication(word))
            first = [objects << 16 | 0x0108] if not number else []
            filled = [*first, *[0] * (entries - len(first))]
            eds.record(index + number, f"Mapping {number + 1}", mapping(len(first), filled))
    eds.record(INPUTS, "Inputs", {n: var(f"Input {n}", U8, 0, "ro", 1) for n in range(1, BYTES + 1)})
    eds.record(OUTPUTS, "Outputs", {n: var(f"Output {n}", U8, 0, "rww", 1) for n in range(1, BYTES + 1)})
    return eds
