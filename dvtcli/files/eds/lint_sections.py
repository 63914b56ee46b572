"""Rules about sections: FileInfo, DeviceInfo, DummyUsage, lists, short forms, DeviceComissioning."""

from __future__ import annotations

import re
from collections.abc import Iterator
from datetime import date

from dvtcli.domain.datatypes import DATA_TYPES
from dvtcli.domain.lint import NOTE, WARNING, check
from dvtcli.domain.lint.described import default_pdos
from dvtcli.domain.object_dictionary import ObjectType
from dvtcli.domain.objects import IDENTITY, MANDATORY, MANUFACTURER_AREA
from dvtcli.domain.pdo import DUMMY_BITS, MAX_PDO_BITS, Pdo
from dvtcli.domain.standard_objects import source
from dvtcli.files.eds.ini import IniSection, IniValue
from dvtcli.files.eds.linted_text import Found, LintedText, all_given, given, missing_keys, no_section
from dvtcli.files.eds.numbers import quoted, read_number, without_comment

_SOURCE = "CiA 306, FileInfo"
_NEEDED = ("FileName", "FileVersion", "FileRevision", "EDSVersion", "Description", "CreationTime", "CreationDate",
           "CreatedBy", "ModificationTime", "ModificationDate", "ModifiedBy")  # fmt: skip
_DATE = re.compile(r"([0-9]{2})-([0-9]{2})-([0-9]{4})")
_TIME = re.compile(r"(0[1-9]|1[0-2]):[0-5][0-9](AM|PM)")


@check("no-file-info", WARNING, "there is no FileInfo", _SOURCE)
def no_file_info(text: LintedText) -> Found:
    """Versions of the file cannot be told apart."""
    return no_section(text, "FileInfo", "versions of the file cannot be distinguished")


@check("missing-file-info", NOTE, "FileInfo lacks keys that it must have", _SOURCE)
def missing_file_info(text: LintedText) -> Found:
    """Reports all missing keys in one finding."""
    return missing_keys(text, "FileInfo", _NEEDED)


@check("file-name", NOTE, "FileName is not the file's name", _SOURCE)
def file_name(text: LintedText) -> Found:
    """The file was renamed, or its FileInfo was copied."""
    named = given(text.values("fileinfo"), "filename")
    if named is not None and re.split(r"[\\/]", named.value)[-1].lower() != text.name.lower():
        yield named.line, f"{quoted(named)}, but the file is called {text.name}"


@check("file-version", WARNING, "FileVersion or FileRevision is not within 0..255", _SOURCE)
def file_version(text: LintedText) -> Found:
    """Tools compare them as numbers."""
    for value in all_given(text.values("fileinfo"), ("fileversion", "filerevision")):
        if not _is_byte(value.value):
            yield value.line, f"{quoted(value)} is not within 0..255"


@check("eds-version", NOTE, "EDSVersion is not a version of the standard (3.0, 4.0)", _SOURCE)
def eds_version(text: LintedText) -> Found:
    """An absent EDSVersion means 3.0."""
    value = given(text.values("fileinfo"), "edsversion")
    if value is not None and value.value not in ("3.0", "4.0"):
        yield value.line, f"{quoted(value)}: the versions are 3.0 and 4.0"


@check("file-date", NOTE, "a date is not written MM-DD-YYYY, or is none", _SOURCE)
def file_date(text: LintedText) -> Found:
    """The day stands in the middle."""
    for value in all_given(text.values("fileinfo"), ("creationdate", "modificationdate")):
        if _day(value) is None:
            yield value.line, f"{quoted(value)} is not a date; write MM-DD-YYYY"


@check("file-time", NOTE, "a time is not written HH:MMAM or HH:MMPM", _SOURCE)
def file_time(text: LintedText) -> Found:
    """Times are in the 12-hour form."""
    for value in all_given(text.values("fileinfo"), ("creationtime", "modificationtime")):
        if not _TIME.fullmatch(value.value.upper()):
            yield value.line, f"{quoted(value)} is not a time; write HH:MMAM or HH:MMPM"


@check("modified-before-created", NOTE, "the file was modified before it was created", _SOURCE)
def modified_before_created(text: LintedText) -> Found:
    """Either date belongs to another file."""
    values = text.values("fileinfo")
    created, modified = (given(values, key) for key in ("creationdate", "modificationdate"))
    if created is None or modified is None:
        return
    first, last = _day(created), _day(modified)
    if first is not None and last is not None and last < first:
        yield modified.line, f"modified on {last}, created on {first}"


def _day(value: IniValue) -> date | None:
    parts = _DATE.fullmatch(value.value)
    try:
        return date(int(parts[3]), int(parts[1]), int(parts[2])) if parts else None
    except ValueError:
        return None


def _is_byte(text: str) -> bool:
    try:
        return 0 <= read_number(text) <= 0xFF
    except ValueError:
        return False


_DEVICE_INFO = "CiA 306, DeviceInfo"
_DUMMIES = "CiA 306, 4.6.1: DummyUsage"
_RATE_KEYS = tuple(f"BaudRate_{rate}" for rate in (10, 20, 50, 125, 250, 500, 800, 1000))
_FLAGS = (*_RATE_KEYS, "SimpleBootUpMaster", "SimpleBootUpSlave", "DynamicChannelsSupported", "GroupMessaging",
          "LSS_Supported")  # fmt: skip
_NEEDED_IN_DEVICE_INFO = (
    "VendorName", "VendorNumber", "ProductName", "ProductNumber", "RevisionNumber", "OrderCode", *_FLAGS,
    "Granularity", "NrOfRXPDO", "NrOfTXPDO",
)  # fmt: skip
#: Keys that may also be a count, e.g. of dynamic channels.
_COUNTS = ("DynamicChannelsSupported",)


@check("no-device-info", WARNING, "there is no DeviceInfo", _DEVICE_INFO)
def no_device_info(text: LintedText) -> Found:
    """Bit rates, counts of PDOs and identity are missing."""
    return no_section(text, "DeviceInfo", "identity, bit rates and counts of PDOs are missing")


@check("missing-device-info", NOTE, "DeviceInfo lacks keys that it must have", _DEVICE_INFO)
def missing_device_info(text: LintedText) -> Found:
    """Reports all missing keys in one finding."""
    return missing_keys(text, "DeviceInfo", _NEEDED_IN_DEVICE_INFO)


@check("vendor-id", WARNING, "the vendor-ID is 0 or missing: no node can be identified by the file",
       source(0x1018))  # fmt: skip
def vendor_id(text: LintedText) -> Found:
    """Neither VendorNumber nor 0x1018:01 names a maker."""
    section = text.section("deviceinfo")
    if not text.file.dictionary.info.vendor_id and section is not None:
        value = text.values("deviceinfo").get("vendornumber")
        yield section.line if value is None else value.line, "no vendor-ID: a node cannot be identified by this file"


@check("no-bit-rate", WARNING, "no bit rate is supported", _DEVICE_INFO)
def no_bit_rate(text: LintedText) -> Found:
    """Every device supports at least one bit rate."""
    section = text.section("deviceinfo")
    if section is not None and not text.file.dictionary.info.bit_rates_kbit:
        yield section.line, "no BaudRate_… is 1: the device would support no bit rate"


@check("flag-value", WARNING, "a key of DeviceInfo that is 0 or 1 has another value", _DEVICE_INFO)
def flag_value(text: LintedText) -> Found:
    """Tools differ in reading other values."""
    flags = (key.lower() for key in _FLAGS if key not in _COUNTS)
    for value in all_given(text.values("deviceinfo"), flags):
        if without_comment(value.value).lower() not in _ZERO_OR_ONE:
            yield value.line, f"{quoted(value)} is neither 0 nor 1"


_ZERO_OR_ONE = ("0", "1", "0x0", "0x1", "0x00", "0x01")


@check("lss-identity", NOTE, "LSS_Supported=1, and 0x1018 has not all four parts", "CiA 305, LSS address")
def lss_identity(text: LintedText) -> Found:
    """A node is chosen by vendor-ID, product code, revision and serial number."""
    value, dictionary = given(text.values("deviceinfo"), "lss_supported"), text.file.dictionary
    missing = [f"{sub:02X}" for sub in range(1, 5) if dictionary.entry(IDENTITY, sub) is None]
    if value is not None and value.value == "1" and IDENTITY in dictionary and missing:
        yield value.line, f"{quoted(value)}, but 1018 has no sub-index {', '.join(missing)}: LSS chooses a node by it"


@check("group-messaging", NOTE, "GroupMessaging=0, and a PDO is multiplexed", "CiA 306, DeviceInfo: GroupMessaging")
def group_messaging(text: LintedText) -> Found:
    """GroupMessaging is about multiplexed PDOs."""
    value, dictionary = given(text.values("deviceinfo"), "groupmessaging"), text.file.dictionary
    if value is not None and value.value == "0":
        multiplexed = [pdo for pdo in default_pdos(dictionary, 1) if pdo.config.mpdo is not None]
        yield from ((value.line, f"{quoted(value)}, but {pdo.pdo.label} is multiplexed") for pdo in multiplexed[:1])


@check("granularity-value", WARNING, "Granularity is above 64 bits", "CiA 306, DeviceInfo: Granularity")
def granularity_value(text: LintedText) -> Found:
    """A PDO holds no more."""
    value = text.values("deviceinfo").get("granularity")
    granularity = text.file.dictionary.info.granularity
    if value is not None and granularity is not None and granularity > MAX_PDO_BITS:
        yield value.line, f"{quoted(value)}: a PDO has {MAX_PDO_BITS} bits"


@check("granularity-zero", NOTE, "Granularity=0 means that nothing can be mapped, but a mapping is writable",
       "CiA 306, DeviceInfo: Granularity")  # fmt: skip
def granularity_zero(text: LintedText) -> Found:
    """The access types count; tools that go by the key refuse to map."""
    value, dictionary = text.values("deviceinfo").get("granularity"), text.file.dictionary
    if value is None or dictionary.info.granularity != 0:
        return
    for index in dictionary:
        pdo = Pdo.at(index)
        entry = dictionary.entry(index, 1) if pdo is not None and pdo.mapping_index == index else None
        if entry is not None and entry.access.writable:
            yield value.line, f"{quoted(value)} means that no mapping can change, but {entry.object} is {entry.access}"
            return


@check("no-dummy-usage", NOTE, "there is no DummyUsage: the dummies of RPDOs are not known", _DUMMIES)
def no_dummy_usage(text: LintedText) -> Found:
    """Applies to files with RPDOs only."""
    pdos = [pdo for pdo in map(Pdo.at, text.file.dictionary) if pdo is not None]
    if any(not pdo.is_tpdo for pdo in pdos):
        yield from no_section(text, "DummyUsage", "the dummies of RPDOs are not known")


@check("missing-dummy", NOTE, "DummyUsage does not name all of Dummy0001 to Dummy0007", _DUMMIES)
def missing_dummy(text: LintedText) -> Found:
    """Some libraries refuse the file."""
    return missing_keys(text, "DummyUsage", [f"Dummy{index:04X}" for index in DUMMY_BITS])


@check("dummy-type", WARNING, "DummyUsage allows what is not a data type of a fixed length", _DUMMIES)
def dummy_type(text: LintedText) -> Found:
    """A dummy skips the bits of its data type."""
    for index in sorted(text.file.dictionary.info.dummies or ()):
        known = DATA_TYPES.get(index)
        if known is None or known.bits is None:
            value = text.values("dummyusage")[f"dummy{index:04x}"]
            yield value.line, f"{quoted(value)}: 0x{index:04X} is not a data type of a fixed length"


_LISTS = "CiA 306, 4.6.2"
_COMPACT = "CiA 306, 4.6.3.3"


@check("wrong-list", NOTE, "an object is in a list that is not for it", _LISTS)
def wrong_list(text: LintedText) -> Found:
    """Mandatory ones are 0x1000, 0x1001 and 0x1018, the manufacturer's 0x2000 to 0x5FFF, the rest optional."""
    for name in ("mandatoryobjects", "optionalobjects", "manufacturerobjects"):
        for row, index in _rows(text, name):
            right = "manufacturer" if index in MANUFACTURER_AREA else "mandatory" if index in MANDATORY else "optional"
            # A profile may make more objects mandatory, and they may be listed so.
            if right not in (name.removesuffix("objects"), "optional") or (
                right == "optional" and name == "manufacturerobjects"
            ):
                yield row.line, f"{index:04X} belongs to [{right.capitalize()}Objects]"


@check("list-numbering", NOTE, "the rows of a list are not numbered 1, 2, 3…", _LISTS)
def list_numbering(text: LintedText) -> Found:
    """Tools that count up from 1 stop at the gap. Said once a list."""
    for name in ("mandatoryobjects", "optionalobjects", "manufacturerobjects"):
        for number, (row, _) in enumerate(_rows(text, name), 1):
            if row.key != str(number):
                yield row.line, f"{quoted(row)} is row {number} of its list"
                break


@check("compact-record", NOTE, "CompactSubObj of an object that is not an ARRAY", _COMPACT)
def compact_record(text: LintedText) -> Found:
    """CompactSubObj makes all sub-indices equal, unlike in a RECORD."""
    for entry in text.objects:
        if "compactsubobj" in entry.values and entry.sub_index is None:
            held = text.file.dictionary[entry.index]
            if len(held.entries) > 1 and held.object_type != ObjectType.ARRAY:
                yield (
                    entry.values["compactsubobj"].line,
                    f"CompactSubObj, but ObjectType is 0x{held.object_type:X}",
                )


@check("compact-and-sub", NOTE, "an object in short form has sections of sub-indices, too", _COMPACT)
def compact_and_sub(text: LintedText) -> Found:
    """They count; some readers take the short form only."""
    for entry in text.objects:
        value = entry.values.get("compactsubobj")
        if (
            value is not None
            and value.value not in ("", "0")
            and entry.sub_index is None
            and entry.index in text.of_many
        ):
            yield value.line, f"{quoted(value)}, and sections of its sub-indices"


@check(
    "table-without-compact",
    NOTE,
    "a table of names, values or denotations of an object that is not in short form",
    _COMPACT,
)
def table_without_compact(text: LintedText) -> Found:
    """Other readers ignore the table."""
    compact = {entry.index for entry in text.objects if "compactsubobj" in entry.values}
    for index in text.file.layout.objects:
        if index not in compact:
            sections = text.file.layout.object_sections(index)
            tables = sections.names + sections.values + sections.denotations
            yield from ((part.line, f"[{part.name}], but no CompactSubObj") for part in tables)


@check("missing-deftype", WARNING, "DataType names a type of the device's own that is not in the file",
       "CiA 301, 7.4.1")  # fmt: skip
def missing_deftype(text: LintedText) -> Found:
    """The object's contents are unknown."""
    for entry in text.objects:
        value = entry.values.get("datatype")
        code = None if value is None else _number(value)
        own = code is not None and code not in DATA_TYPES and 0x20 <= code < 0x1000
        if value is not None and own and code not in text.file.dictionary:
            yield value.line, f"{quoted(value)}, but the file has no object {code:04X} (DEFTYPE, DEFSTRUCT)"


def _rows(text: LintedText, name: str) -> Iterator[tuple[IniValue, int]]:
    for key, row in text.values(name).items():
        index = _number(row)
        if key.replace(" ", "") != "supportedobjects" and index is not None:
            yield row, index


def _number(value: IniValue) -> int | None:
    try:
        return read_number(without_comment(value.value))
    except ValueError:
        return None


_COMMISSIONING = "CiA 306, 5"
_SECTION = "devicecomissioning"
_RATES = (10, 20, 50, 125, 250, 500, 800, 1000)


@check("parameter-value-in-eds", WARNING, "an EDS sets values (ParameterValue)", f"{_COMMISSIONING}: ParameterValue")
def parameter_value_in_eds(text: LintedText) -> Found:
    """The value belongs to a single device, not to the type; tools that read an EDS ignore it."""
    if text.is_eds:
        for entry in text.objects:
            value = given(entry.values, "parametervalue")
            if value is not None:
                yield value.line, f"{quoted(value)} is a DCF's: in an EDS it counts for some tools only"


@check("commissioning-in-eds", WARNING, "an EDS has DeviceComissioning", f"{_COMMISSIONING}: DeviceComissioning")
def commissioning_in_eds(text: LintedText) -> Found:
    """A node-ID belongs to a DCF."""
    section = text.section(_SECTION)
    if text.is_eds and section is not None:
        yield section.line, f"[{section.name}] belongs to a DCF"


@check("unknown-module", WARNING, "ConnectedModules names a module that the file does not describe",
       "CiA 306, 4.8 and 5.4: SupportedModules, ConnectedModules")  # fmt: skip
def unknown_module(text: LintedText) -> Found:
    """What such a module adds is missing in the device that the file describes."""
    modules = text.file.dictionary.info.modules
    for part in text.file.layout.modules.get("connectedmodules", [])[:1]:
        for module in modules.without_description(modules.connected):
            yield (
                part.line,
                f"module {module} is connected, but not described: its objects are unknown",
            )


@check("no-commissioning", NOTE, "a DCF without NodeID in DeviceComissioning", f"{_COMMISSIONING}: DeviceComissioning")
def no_commissioning(text: LintedText) -> Found:
    """The file does not name its node."""
    section = text.section(_SECTION)
    if text.is_dcf and "nodeid" not in text.values(_SECTION):
        yield section.line if section else 1, "no NodeID in [DeviceComissioning]: the node of the file is unknown"


@check("commissioning-spelling", NOTE, "DeviceCommissioning with two m, the standard has one",
       f"{_COMMISSIONING}: DeviceComissioning")  # fmt: skip
def commissioning_spelling(text: LintedText) -> Found:
    """Most tools look for the standard's spelling and miss the node-ID."""
    section = text.section(_SECTION)
    if section is not None and section.name.lower() != _SECTION:
        yield section.line, f"[{section.name}] is spelled [DeviceComissioning] in the standard: most tools miss it"


@check("commissioned-bit-rate", WARNING, "Baudrate is not one of CiA 301's (kbit/s), or one that DeviceInfo says 0 to",
       f"{_COMMISSIONING}: Baudrate")  # fmt: skip
def commissioned_bit_rate(text: LintedText) -> Found:
    """The node could not communicate."""
    value = given(text.values(_SECTION), "baudrate")
    if value is None:
        return
    try:
        rate = read_number(without_comment(value.value))
    except ValueError:
        rate = -1
    supported = text.file.dictionary.info.bit_rates_kbit
    if rate == 0:  # not set
        return
    if rate not in _RATES:
        rates = ", ".join(map(str, _RATES))
        yield value.line, f"{quoted(value)} is not a bit rate; the bit rates are {rates} kbit/s"
    elif supported and rate not in supported:
        yield value.line, f"{quoted(value)}, but BaudRate_{rate} is not 1"


_LONGEST = 255
_FORMAT = "CiA 306, 4.2"


@check("byte-order-mark", WARNING, "the file begins with a byte-order mark: many readers miss its first section",
       _FORMAT)  # fmt: skip
def byte_order_mark(text: LintedText) -> Found:
    """The standard has plain characters of a byte each."""
    if text.file.text.encoding in ("utf-8-sig", "utf-16"):
        yield 1, f"the file begins with a byte-order mark ({text.file.text.encoding.upper()})"


@check("non-ascii", NOTE, "a character beyond ASCII: readers differ in which one it is", _FORMAT)
def non_ascii(text: LintedText) -> Found:
    """Reports the first line only."""
    for section in _parts(text):
        if not section.text.isascii():
            line, words = next((n, part) for n, part in enumerate(section.text.split("\n")) if not part.isascii())
            sign = next(sign for sign in words if not sign.isascii())
            encoding = text.file.text.encoding.upper()
            yield section.line + line, f"{sign!r} is beyond ASCII, the first here; the file was read as {encoding}"
            return


@check("line-ends", NOTE, "lines do not all end with CR LF", _FORMAT)
def line_ends(text: LintedText) -> Found:
    """Said once."""
    if text.file.text.mixed_line_ends:
        yield 1, "some lines end with CR LF and others do not"
    elif text.file.text.newline != "\r\n":
        yield 1, f"lines end with {'LF' if text.file.text.newline == chr(10) else 'CR'}, not CR LF"


@check("long-line", NOTE, "a line has more than 255 characters", _FORMAT)
def long_line(text: LintedText) -> Found:
    """Some readers cut long lines."""
    for section in _parts(text):
        if len(section.text) > _LONGEST:
            for number, words in enumerate(section.text.split("\n"), section.line):
                if len(words) > _LONGEST:
                    yield number, f"the line has {len(words)} characters; {_LONGEST} are allowed"


@check("header-case", NOTE, "a sub-index is called SUB in capitals: some libraries drop it", "CiA 306, 4.6.3")
def header_case(text: LintedText) -> Found:
    """The standard writes `[1018sub0]`."""
    for entry in text.objects:
        section = entry.section
        if entry.sub_index is not None and section.name[4:7] not in ("sub", "Sub"):
            yield section.line, f"[{section.name}] is written [{section.name[:4]}sub{section.name[7:]}]"


def _parts(text: LintedText) -> tuple[IniSection, ...]:
    return text.file.text.preamble, *text.file.text.sections
