"""The sections of an EDS or DCF: sorted by name, and those about the whole device."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field

from dvtcli.domain.object_dictionary import Commissioning, DeviceInfo, OdObject
from dvtcli.files.eds.findings import (
    BAD_LINE,
    BAD_NUMBER,
    DEVICE_IDENTITY,
    DUPLICATE_SECTION,
    LIST_COUNT,
    LISTED_TWICE,
    NO_NODE_ID,
    NO_SECTION,
    NODE_ID,
    NOT_LISTED,
    NOT_UNDERSTOOD,
    Findings,
)
from dvtcli.files.eds.ini import IniSection, IniText, IniValue, Values, section_values
from dvtcli.files.eds.numbers import number_key, quoted, read_number, text_key, without_comment

#: The lists of objects, in the standard's order.
OBJECT_LISTS = ("mandatoryobjects", "optionalobjects", "manufacturerobjects")
_OBJECT = re.compile(
    r"([0-9a-f]{4})(?:sub[0-9a-f]{1,2}|(name|value|denotation|objectlinks))?", re.IGNORECASE | re.ASCII
)
_DEVICE = {"fileinfo", "deviceinfo", "dummyusage", "comments", "devicecomissioning", *OBJECT_LISTS}
#: Sections that say nothing of the dictionary: data types, dynamic channels, tools (CiA 306, 4.6.1, 4.7 and 4.9).
_KEPT = r"(?a)standarddatatypes|dynamicchannels|tools|tool[0-9]+"
#: Sections of modular devices (CiA 306, 4.8 and 5.4): the module's number, and which of its sections.
_MODULES = (
    r"(?a)supportedmodules|connectedmodules"
    r"|m([0-9]{1,3})(moduleinfo|comments|fixedobjects|subextends|(?:fixed|subext)[0-9a-f]{4}(?:sub[0-9a-f]{1,2}"
    r"|name|value|denotation|objectlinks)?)"
)
#: CiA 306 spells it with one m; some tools correct the spelling.
_SAME = {"devicecommissioning": "devicecomissioning"}
#: All parts of a repeated section, in order; nearly always one.
Parts = list[IniSection]


@dataclass(slots=True, eq=False, repr=False)
class ObjectSections:
    """An object's sections: *own*, by sub-index, tables of a compact object, and *links* to other objects."""

    own: Parts = field(default_factory=list)
    sub_indices: dict[int, Parts] = field(default_factory=dict)
    names: Parts = field(default_factory=list)
    values: Parts = field(default_factory=list)
    denotations: Parts = field(default_factory=list)
    links: Parts = field(default_factory=list)

    @property
    def line(self) -> int:
        """The object's first line: of its own section, else of its first sub-index."""
        return self.own[0].line if self.own else min(parts[0].line for parts in self.sub_indices.values())

    def each(self) -> Iterator[Parts]:
        """Iterate over every section with its repetitions."""
        yield from (self.own, self.names, self.values, self.denotations, self.links)
        yield from self.sub_indices.values()


@dataclass(slots=True, eq=False, repr=False)
class EdsLayout:
    """A file's sections by meaning, *objects* by index only; *stray* sections have no known meaning.

    *modules* are the sections of a modular device by name in lower case; *kept* say nothing of the dictionary.
    """

    device: dict[str, Parts] = field(default_factory=dict)
    objects: dict[int, Parts] = field(default_factory=dict)
    modules: dict[str, Parts] = field(default_factory=dict)
    kept: dict[str, Parts] = field(default_factory=dict)
    stray: Parts = field(default_factory=list)

    @property
    def recognised(self) -> bool:
        """Whether the file has any section of an EDS."""
        return bool(self.objects or self.device.keys() - {"comments"})

    def object_sections(self, index: int) -> ObjectSections:
        """Return the sections of the existing object *index*, sorted by content."""
        found = ObjectSections()
        for section in self.objects[index]:
            name = section.name[4:].lower()
            if not name:
                found.own.append(section)
            elif name.startswith("sub"):
                found.sub_indices.setdefault(int(name[3:], 16), []).append(section)
            else:
                tables = {"name": found.names, "value": found.values, "denotation": found.denotations}
                tables.get(name, found.links).append(section)
        return found


def object_place(name: str) -> tuple[int, int | None] | None:
    """Return index and sub-index (None: the object) of the section *name*; None for other sections."""
    if _OBJECT.fullmatch(name) is None:
        return None
    sub = name[7:] if name[4:7].lower() == "sub" else ""
    return int(name[:4], 16), int(sub, 16) if sub else None


def lay_out(text: IniText) -> EdsLayout:
    """Sort a file's sections by meaning; names in any case."""
    layout = EdsLayout()
    objects, match_object = layout.objects, _OBJECT.fullmatch
    described = set()
    for section in text.sections:
        found = match_object(section.name)
        if found is None:
            _add_device_section(layout, section)
            continue
        digits, table = found.groups()
        index = int(digits, 16)
        if table is None:
            described.add(index)
        if index in objects:
            objects[index].append(section)
        else:
            objects[index] = [section]
    # A table whose object the file does not have tells us nothing.
    for index in objects.keys() - described:
        layout.stray += objects.pop(index)
    return layout


def _add_device_section(layout: EdsLayout, section: IniSection) -> None:
    name = section.name.lower()
    name = _SAME.get(name, name)
    if name in _DEVICE:
        layout.device.setdefault(name, []).append(section)
    elif re.fullmatch(_MODULES, name):
        layout.modules.setdefault(name, []).append(section)
    elif re.fullmatch(_KEPT, name):
        layout.kept.setdefault(name, []).append(section)
    else:
        layout.stray.append(section)


def report_stray(layout: EdsLayout, findings: Findings) -> None:
    """Report a note for each unknown section; its text is kept."""
    for section in layout.stray:
        kind = "belongs to no object in this file" if _OBJECT.fullmatch(section.name) else "is not known here"
        findings.add(NOT_UNDERSTOOD, section.line, f"section [{section.name}] {kind}: not understood, kept as it is")


def report_repeated(every: Iterable[Parts], findings: Findings, *, have_values: bool = False) -> None:
    """Report a warning for each repeated section; *have_values*: the section contains values."""
    for parts in every:
        for part in parts[1:]:
            text = f"[{part.name}] is in line {parts[0].line} too; where both have a key, the later one counts"
            findings.add(DUPLICATE_SECTION, part.line, text, value_unread=have_values)


_DUMMY = re.compile(r"dummy([0-9a-f]{4})")
_U32 = 0xFFFF_FFFF
_HIGHEST_NODE_ID = 127
_UNCONFIGURED = 255
_BIT_RATES_KBIT = (10, 20, 50, 100, 125, 250, 500, 800, 1000)


def read_device_info(values: Values, layout: EdsLayout, identity: OdObject | None, findings: Findings) -> DeviceInfo:
    """Read the device data of *values* (DeviceInfo); missing numbers come from *identity* (0x1018)."""
    return DeviceInfo(
        vendor_name=text_key(values, "vendorname"),
        product_name=text_key(values, "productname"),
        vendor_id=_identity(values, "vendornumber", identity, 1, findings),
        product_code=_identity(values, "productnumber", identity, 2, findings),
        revision_number=_identity(values, "revisionnumber", identity, 3, findings),
        granularity=number_key(values, "granularity", 0, 0xFF, findings),
        rpdo_count=number_key(values, "nrofrxpdo", 0, 512, findings),
        tpdo_count=number_key(values, "nroftxpdo", 0, 512, findings),
        node_id=_node_id(layout, findings),
        bit_rates_kbit=tuple(
            rate for rate in _BIT_RATES_KBIT if number_key(values, f"baudrate_{rate}", 0, _U32, findings)
        ),
        dummies=_dummies(layout, findings),
        order_code=text_key(values, "ordercode"),
        boot_up_master=_flag(values, "simplebootupmaster"),
        boot_up_slave=_flag(values, "simplebootupslave"),
        dynamic_channels=number_key(values, "dynamicchannelssupported", 0, _U32, Findings()),
        group_messaging=_flag(values, "groupmessaging"),
        lss_supported=_flag(values, "lss_supported"),
        commissioning=_commissioning(layout),
    )


def _flag(values: Values, key: str) -> bool | None:
    """Read a key with the value 0 or 1; `eds.lint_sections` reports other values."""
    number = number_key(values, key, 0, 1, Findings())
    return None if number is None else bool(number)


def _commissioning(layout: EdsLayout) -> Commissioning:
    """Read DeviceComissioning without the node-ID; `eds.lint_sections` reports malformed numbers."""
    unsaid = Findings()
    values = section_values(layout.device.get("devicecomissioning", ()), unsaid)
    return Commissioning(
        text_key(values, "nodename"),
        number_key(values, "baudrate", 0, _U32, unsaid),
        number_key(values, "netnumber", 0, _U32, unsaid),
        text_key(values, "networkname"),
        _flag(values, "canopenmanager"),
        number_key(values, "lss_serialnumber", 0, _U32, unsaid),
    )


def _identity(values: Values, key: str, identity: OdObject | None, sub_index: int, findings: Findings) -> int | None:
    """Read a number of DeviceInfo, else the default of 1018:*sub_index*; warns if both exist and differ."""
    given = number_key(values, key, 0, _U32, findings)
    entry = None if identity is None else identity.entries.get(sub_index)
    data = None if entry is None else entry.initial(0)
    in_object = None if data is None or len(data) > 4 else int.from_bytes(data, "little")
    if given is None:
        return in_object
    if in_object not in (None, given):
        text = f"{quoted(values[key])}, but 1018:{sub_index:02X} holds 0x{in_object:08X}"
        findings.add(DEVICE_IDENTITY, values[key].line, text)
    return given


def _node_id(layout: EdsLayout, findings: Findings) -> int | None:
    sections = layout.device.get("devicecomissioning", ())
    values = section_values(sections, findings)
    if len(differing := _given_node_ids(sections)) > 1:
        every = ", ".join(f"{number} in line {line}" for number, line in differing.items())
        text = f"NodeID is {every}: it is not known which of them is meant; ignored"
        findings.add(NODE_ID, values["nodeid"].line, text, value_lost=True)
        return None
    given = values.get("nodeid")
    if given is None or not without_comment(given.value):
        return None
    node_id = _whole_number(given)
    if node_id is None or not (0 <= node_id <= _HIGHEST_NODE_ID or node_id == _UNCONFIGURED):
        text = f"{quoted(given)} is not a node-ID (1..127): the node of the values is unknown; ignored"
        findings.add(NODE_ID, given.line, text, value_lost=True)
        return None
    if 1 <= node_id <= _HIGHEST_NODE_ID:
        return number_key(values, "nodeid", 0, 0xFF, findings)  # which says what is odd in it
    if node_id == _UNCONFIGURED:
        findings.add(NO_NODE_ID, given.line, f"{quoted(given)} means not configured")
    else:
        findings.add(NODE_ID, given.line, f"{quoted(given)} is not within 1..127; ignored")
    return None


def _whole_number(given: IniValue) -> int | None:
    """Return the number of a key, None if malformed."""
    try:
        return read_number(without_comment(given.value))
    except ValueError:
        return None


def _given_node_ids(sections: Iterable[IniSection]) -> dict[int, int]:
    """Return every node-ID in the sections with its line; a key may occur twice."""
    found: dict[int, int] = {}
    for section in sections:
        for line, text in enumerate(section.text.split("\n")):
            key, _, value = text.partition("=")
            if key.strip().lower() == "nodeid":
                given = {"nodeid": IniValue("NodeID", value.strip(), section.line + line)}
                number = number_key(given, "nodeid", 1, _HIGHEST_NODE_ID, Findings())
                if number is not None:
                    found.setdefault(number, section.line + line)
    return found


def _dummies(layout: EdsLayout, findings: Findings) -> frozenset[int] | None:
    """The data types that may pad an RPDO; a type the section does not mention may not. None without the section."""
    if "dummyusage" not in layout.device:
        return None
    values = section_values(layout.device["dummyusage"], findings)
    allowed = set()
    for key, value in values.items():
        found = _DUMMY.fullmatch(key)
        if found is None:
            findings.add(BAD_LINE, value.line, f"{quoted(value)} in [DummyUsage] is not understood; ignored")
        elif number_key(values, key, 0, 1, findings):
            allowed.add(int(found[1], 16))
    return frozenset(allowed)


def check_lists(layout: EdsLayout, findings: Findings) -> tuple[int, ...]:
    """Compare the lists of objects with the file's objects; returns the listed indices in order."""
    listed: dict[int, None] = {}
    for name in OBJECT_LISTS:
        listed |= _check_list(layout, name, listed, findings)
    if listed:
        for index in sorted(layout.objects.keys() - listed.keys()):
            line = layout.object_sections(index).line
            findings.add(NOT_LISTED, line, f"no list of objects names {index:04X}; read all the same")
    return tuple(listed)


def _check_list(layout: EdsLayout, name: str, listed: Mapping[int, None], findings: Findings) -> dict[int, None]:
    parts = layout.device.get(name, [])
    values = section_values(parts, findings)
    # "Supported Objects" with a blank is seen in real files; it must not be taken for an entry of the list.
    counts = [key for key in values if key.replace(" ", "") == "supportedobjects"]
    rows = [value for key, value in values.items() if key not in counts]
    for key in counts:
        count = number_key(values, key, 0, 0xFFFF, findings)
        if count is not None and count != len(rows):
            text = f"{values[key].key}={count}, but [{parts[0].name}] lists {len(rows)}"
            findings.add(LIST_COUNT, values[key].line, text)
    found: dict[int, None] = {}
    for row in rows:
        try:
            index = read_number(without_comment(row.value))
        except ValueError:
            findings.add(BAD_NUMBER, row.line, f"{quoted(row)} in [{parts[0].name}] is not an index; ignored")
            continue
        if index in listed or index in found:
            findings.add(LISTED_TWICE, row.line, f"{index:04X} is listed twice")
        elif index not in layout.objects:
            findings.add(NO_SECTION, row.line, f"{index:04X} is listed but has no section: it is left out")
        found[index] = None
    return found
