"""Rules about DeviceInfo and DummyUsage: what a file says of the device as a whole."""

from __future__ import annotations

from dvtcli.domain.datatypes import DATA_TYPES
from dvtcli.domain.lint.default_pdos import default_pdos
from dvtcli.domain.lint.lint_rule import NOTE, WARNING, check
from dvtcli.domain.mapping import DUMMY_BITS, MAX_PDO_BITS
from dvtcli.domain.pdo import Pdo
from dvtcli.files.eds.keys import quoted
from dvtcli.files.eds.lint.linted_text import Found, LintedText, all_given, given
from dvtcli.files.eds.lint.needed_section import missing_keys, no_section
from dvtcli.files.eds.numbers import without_comment

_SOURCE = "CiA 306, DeviceInfo"
_DUMMIES = "CiA 306, 4.6.1: DummyUsage"
_RATES = tuple(f"BaudRate_{rate}" for rate in (10, 20, 50, 125, 250, 500, 800, 1000))
_FLAGS = (*_RATES, "SimpleBootUpMaster", "SimpleBootUpSlave", "DynamicChannelsSupported", "GroupMessaging",
          "LSS_Supported")  # fmt: skip
_NEEDED = ("VendorName", "VendorNumber", "ProductName", "ProductNumber", "RevisionNumber", "OrderCode", *_FLAGS,
           "Granularity", "NrOfRXPDO", "NrOfTXPDO")  # fmt: skip
#: Keys that may also be a number: how many dynamic channels there are.
_COUNTS = ("DynamicChannelsSupported",)


@check("no-device-info", WARNING, "there is no DeviceInfo", _SOURCE)
def no_device_info(text: LintedText) -> Found:
    """Bit rates, counts of PDOs and identity are missing."""
    return no_section(text, "DeviceInfo", "identity, bit rates and counts of PDOs are missing")


@check("missing-device-info", NOTE, "DeviceInfo lacks keys that it must have", _SOURCE)
def missing_device_info(text: LintedText) -> Found:
    """Said once, with all of them."""
    return missing_keys(text, "DeviceInfo", _NEEDED)


@check("vendor-id", WARNING, "the vendor-ID is 0 or missing: no node can be recognised by the file",
       "CiA 301, 7.5.2.21")  # fmt: skip
def vendor_id(text: LintedText) -> Found:
    """Neither VendorNumber nor 0x1018:01 names a maker."""
    section = text.section("deviceinfo")
    if not text.file.dictionary.info.vendor_id and section is not None:
        value = text.values("deviceinfo").get("vendornumber")
        yield section.line if value is None else value.line, "no vendor-ID: a node cannot be recognised by this file"


@check("no-bit-rate", WARNING, "no bit rate is supported", _SOURCE)
def no_bit_rate(text: LintedText) -> Found:
    """A device has one at least."""
    section = text.section("deviceinfo")
    if section is not None and not text.file.dictionary.info.bit_rates_kbit:
        yield section.line, "no BaudRate_… is 1: the device would support no bit rate"


@check("flag-value", WARNING, "a key of DeviceInfo that is 0 or 1 has another value", _SOURCE)
def flag_value(text: LintedText) -> Found:
    """Tools differ in what it means then."""
    flags = (key.lower() for key in _FLAGS if key not in _COUNTS)
    for value in all_given(text.values("deviceinfo"), flags):
        if without_comment(value.value).lower() not in _ZERO_OR_ONE:
            yield value.line, f"{quoted(value)} is neither 0 nor 1"


_ZERO_OR_ONE = ("0", "1", "0x0", "0x1", "0x00", "0x01")


@check("lss-identity", NOTE, "LSS_Supported=1, and 0x1018 has not all four parts", "CiA 305, LSS address")
def lss_identity(text: LintedText) -> Found:
    """A node is chosen by vendor-ID, product code, revision and serial number."""
    value, dictionary = given(text.values("deviceinfo"), "lss_supported"), text.file.dictionary
    missing = [f"{sub:02X}" for sub in range(1, 5) if dictionary.entry(0x1018, sub) is None]
    if value is not None and value.value == "1" and 0x1018 in dictionary and missing:
        yield value.line, f"{quoted(value)}, but 1018 has no sub-index {', '.join(missing)}: LSS chooses a node by it"


@check(
    "group-messaging", NOTE, "GroupMessaging=0, and a PDO comes up multiplexed", "CiA 306, DeviceInfo: GroupMessaging"
)
def group_messaging(text: LintedText) -> Found:
    """Multiplexed PDOs are what it is about."""
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
        yield value.line, f"{quoted(value)}: a PDO holds {MAX_PDO_BITS} bits"


@check("granularity-zero", NOTE, "Granularity=0 says that nothing can be mapped, and a mapping can be written",
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
            yield value.line, f"{quoted(value)} says that no mapping can change, but {entry.object} is {entry.access}"
            return


@check("no-dummy-usage", NOTE, "there is no DummyUsage: nobody knows by what an RPDO may skip bits", _DUMMIES)
def no_dummy_usage(text: LintedText) -> Found:
    """Only a file with RPDOs needs it."""
    pdos = [pdo for pdo in map(Pdo.at, text.file.dictionary) if pdo is not None]
    if any(not pdo.is_tpdo for pdo in pdos):
        yield from no_section(text, "DummyUsage", "by what an RPDO may skip bits is not known")


@check("missing-dummy", NOTE, "DummyUsage does not name all of Dummy0001 to Dummy0007", _DUMMIES)
def missing_dummy(text: LintedText) -> Found:
    """Some libraries refuse the file."""
    return missing_keys(text, "DummyUsage", [f"Dummy{index:04X}" for index in DUMMY_BITS])


@check("dummy-type", WARNING, "DummyUsage allows what is no data type of a fixed length", _DUMMIES)
def dummy_type(text: LintedText) -> Found:
    """A dummy skips as many bits as its type has."""
    for index in sorted(text.file.dictionary.info.dummies or ()):
        known = DATA_TYPES.get(index)
        if known is None or known.bits is None:
            value = text.values("dummyusage")[f"dummy{index:04x}"]
            yield value.line, f"{quoted(value)}: 0x{index:04X} is no data type of a fixed length"
