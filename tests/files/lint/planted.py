"""For each rule a fault that it is there for, planted into a sound file, and what is sound in the same place."""

from __future__ import annotations

from dataclasses import dataclass

from tests.files.lint.sample import COMMISSIONED, HEAD, NAME, SOUND, listed, pdo, record, var


@dataclass(frozen=True)
class Planted:
    """*rule* speaks of *text* in the line where *at* stands; *twin* is sound, by default the file as it was."""

    rule: str
    text: str
    at: str = ""
    twin: str = SOUND
    name: str = NAME
    said: str = ""

    def __str__(self) -> str:
        return self.rule


def changed(old: str, new: str, text: str = SOUND) -> str:
    """*text* with *old*, which it has once, replaced."""
    assert text.count(old) == 1, (text.count(old), old)
    return text.replace(old, new)


def p(rule: str, old: str, new: str, at: str = "", said: str = "", twin: str = "") -> Planted:
    """A fault made by replacing *old* by *new*; sound with *twin* there."""
    sound = changed(old, twin) if twin else SOUND
    return Planted(rule, changed(old, new), at or new.strip("\n").partition("\n")[0], sound, said=said)


def more(rule: str, text: str, at: str = "", said: str = "", twin: str = "") -> Planted:
    """A fault made by more text at the end."""
    return Planted(rule, SOUND + text, at or text.partition("\n")[0], SOUND + twin, said=said)


def without(index: str, text: str = SOUND) -> str:
    """*text* without the object *index* and its sub-indices, in the lists neither."""
    parts = text.split("\n[")
    kept = [part for part in parts if not part.lower().startswith((f"{index}]".lower(), f"{index}sub".lower()))]
    rows = "\n[".join(kept)
    for name in ("MandatoryObjects", "OptionalObjects", "ManufacturerObjects"):
        start = rows.index(f"[{name}]")
        end = rows.index("\n\n", start)
        indices = [line.partition("=0x")[2] for line in rows[start:end].split("\n")[2:]]
        rows = rows[:start] + listed(name, *(one for one in indices if one != index)).rstrip("\n") + rows[end:]
    return rows


def section(name: str) -> str:
    """One section of the sound file, with the blank line behind it."""
    start = SOUND.index(f"[{name}]\n")
    end = SOUND.find("\n[", start)
    return SOUND[start : end + 1]


def in_section(name: str, old: str, new: str, text: str = SOUND) -> str:
    """*text* with *old* replaced by *new* in one section only."""
    whole = section(name)
    return changed(whole, changed(old, new, whole), text)


def s(rule: str, name: str, old: str, new: str, at: str = "", twin: str = "", said: str = "") -> Planted:
    """A fault in one section; the line is the changed one's, counted from the section's."""
    text = in_section(name, old, new)
    sound = in_section(name, old, twin) if twin else SOUND
    return Planted(rule, text, at if "|" in at or at.startswith("[") else f"[{name}]|{at or new}", sound, said=said)


def dcf(rule: str, old: str, new: str, at: str = "", name: str = "pump.dcf") -> Planted:
    """A fault in the DCF that the file becomes with a node-ID."""
    return Planted(rule, changed(old, new, DCF), at or new.partition("\n")[0], DCF, name)


DCF = changed(f"FileName={NAME}", "FileName=pump.dcf", HEAD + COMMISSIONED + SOUND[len(HEAD) :])
_TYPED = "DataType=0x0003\nAccessType=rw\nDefaultValue=100"
_COMPACT = "CompactSubObj=3\n"
TWO_RPDOS = SOUND.replace("NrOfRXPDO=1", "NrOfRXPDO=2")
SECOND_RPDO = TWO_RPDOS + pdo(2, "RPDO", "$NODEID+0x300", ("0x62000008",))
UNMAPPED_RPDO = TWO_RPDOS + pdo(2, "RPDO", "$NODEID+0x80000300", ())

LINES = (
    p("bad-header", "[2000]\n", "[2000\n", "[2000\n"),
    p("bad-line", "ParameterName=Target\n", "ParameterName=Target\nwhat is this\n", "what is this"),
    p("duplicate-key", "ParameterName=Target\n", "ParameterName=Target\nParameterName=Goal\n", "ParameterName=Goal"),
    more(
        "duplicate-section",
        "[2000]\nParameterName=Again\nDataType=0x0003\nAccessType=rw\n",
        "[2000]\nParameterName=Again",
    ),
    more("section-not-understood", "[Tool]\nVersion=1\n", twin=""),
    Planted("byte-order-mark", "\ufeff" + SOUND),
    p("non-ascii", "ParameterName=Target", "ParameterName=Maß", twin="ParameterName=Mass"),
    Planted("line-ends", SOUND, name="lf"),
    p("long-line", "Description=A pump", f"Description={'x' * 250}", twin=f"Description={'x' * 243}"),
    p("header-case", "[2002sub1]", "[2002SUB1]", twin="[2002Sub1]"),
    p("misspelt-key", "HighLimit=500", "HighLimt=500", said="did you mean HighLimit?"),
    p("unknown-key", "HighLimit=500", "HighLimit=500\nColour=red", "Colour=red", twin="HighLimit=500\nUnit=bar"),
    p(
        "key-without-effect",
        "ParameterName=Curve\n",
        "ParameterName=Curve\nDefaultValue=1\n",
        "DefaultValue=1\nObjectType",
    ),
    p("bad-number", "Granularity=8", "Granularity=eight"),
    p("leading-zero", "Granularity=8", "Granularity=010", twin="Granularity=08"),
    s("empty-value", "2001", "DefaultValue=pump", "DefaultValue="),
    p("bad-value", "DefaultValue=pump", "DefaultValue=Pümpe€", said="VISIBLE_STRING"),
    p("odd-value", "DefaultValue=$NODEID+0x80\n", "DefaultValue=$MY_NODEID+0x80\n"),
    p("limit-type", "HighLimit=500", "HighLimit=70000", said="INTEGER16"),
    p("limits-crossed", "LowLimit=-500", "LowLimit=600", "HighLimit=500"),
    p(
        "limits-wrapped",
        "LowLimit=-500\nHighLimit=500",
        "LowLimit=0\nHighLimit=0xFFFF",
        "HighLimit=0xFFFF",
        twin="LowLimit=0\nHighLimit=0x7FFF",
    ),
    p(
        "untyped-value",
        "DataType=0x0003\nAccessType=rw\nDefaultValue=100",
        "AccessType=rw\nDefaultValue=100",
        "DefaultValue=100\nPDOMapping=0\nLowLimit",
    ),
    s(
        "value-twice",
        "2001",
        "DefaultValue=pump",
        "ParameterValue=a\nParameterValue=b",
        "ParameterValue=b",
        "ParameterValue=a\nParameterValue=a",
        said="ParameterValue=a in line",
    ),
    p("misspelt-section", "[DummyUsage]", "[DumyUsage]", said="did you mean [DummyUsage]?"),
    p("limit-without-sense", "DefaultValue=pump\n", "DefaultValue=pump\nHighLimit=5\n", "HighLimit=5\n"),
)
FILE_INFO = (
    Planted("no-file-info", SOUND[SOUND.index("[DeviceInfo]") :]),
    p("missing-file-info", "CreatedBy=Example\n", "", "[FileInfo]", said="CreatedBy"),
    Planted("file-name", SOUND, f"FileName={NAME}", name="valve.eds"),
    p("file-version", "FileVersion=1", "FileVersion=256", twin="FileVersion=255"),
    p("eds-version", "EDSVersion=4.0", "EDSVersion=404", twin="EDSVersion=3.0"),
    p("file-date", "CreationDate=01-31-2024", "CreationDate=31-01-2024", twin="CreationDate=01-30-2024"),
    p("file-time", "CreationTime=09:30AM", "CreationTime=21:30", twin="CreationTime=09:30PM"),
    p("modified-before-created", "ModificationDate=02-01-2024", "ModificationDate=01-30-2024",
      twin="ModificationDate=01-31-2024"),
)  # fmt: skip
_DEVICE = SOUND[SOUND.index("[DeviceInfo]") : SOUND.index("[DummyUsage]")]
_DUMMIES = SOUND[SOUND.index("[DummyUsage]") : SOUND.index("[Comments]")]
DEVICE_INFO = (
    Planted("no-device-info", changed(_DEVICE, "")),
    p("missing-device-info", "OrderCode=P-1\n", "", "[DeviceInfo]", said="OrderCode"),
    p("device-identity", "VendorNumber=0x00000ABC", "VendorNumber=0x00000ABD"),
    Planted("vendor-id", SOUND.replace("0x00000ABC", "0x00000000"), "VendorNumber=0x00000000"),
    Planted("no-bit-rate", SOUND.replace("_125=1", "_125=0").replace("_500=1", "_500=0"),
            "[DeviceInfo]"),
    p("flag-value", "LSS_Supported=0", "LSS_Supported=yes", twin="LSS_Supported=1"),
    p("lss-identity", "LSS_Supported=0", "LSS_Supported=1", said="04"),
    Planted("group-messaging", in_section("1A00sub0", "DefaultValue=2", "DefaultValue=0xFF"), "GroupMessaging=0"),
    p("granularity-value", "Granularity=8", "Granularity=65", twin="Granularity=64"),
    p("granularity-zero", "Granularity=8", "Granularity=0", twin="Granularity=1"),
    Planted("no-dummy-usage", changed(_DUMMIES, "")),
    p("missing-dummy", "Dummy0003=0\n", "", "[DummyUsage]", said="Dummy0003"),
    p("dummy-type", "Dummy0007=1\n", "Dummy0007=1\nDummy0009=1\n", "Dummy0009=1", twin="Dummy0007=1\nDummy0010=1\n"),
    p("pdo-count", "NrOfTXPDO=2", "NrOfTXPDO=3"),
    p("compact-pdo", "NrOfTXPDO=2\n", "NrOfTXPDO=3\nCompactPDO=0x1F\n", "CompactPDO=0x1F"),
    p("compact-pdo-bits", "NrOfTXPDO=2\n", "NrOfTXPDO=3\nCompactPDO=0xFF\n", "CompactPDO=0xFF"),
)  # fmt: skip
LISTS = (
    p("list-count", "[ManufacturerObjects]\nSupportedObjects=5", "[ManufacturerObjects]\nSupportedObjects=6",
      "SupportedObjects=6"),
    p("not-listed", "5=0x2004\n", "", "[2004]\n"),
    p("listed-twice", "5=0x2004\n", "5=0x2004\n6=0x2004\n", "6=0x2004"),
    p("no-section", "5=0x2004\n", "5=0x2004\n6=0x2009\n", "6=0x2009"),
    p("wrong-list", "5=0x2004\n", "5=0x2004\n6=0x6000\n", "6=0x6000"),
    p("list-numbering", "5=0x2004\n", "6=0x2004\n"),
)  # fmt: skip
COMPACT = (
    p("table-count", "NrOfEntries=1", "NrOfEntries=2"),
    p("no-sub-index", "2=Second", "9=Ninth"),
    p("compact-record", "ObjectType=0x8\nDataType=0x0005", "ObjectType=0x9\nDataType=0x0005", _COMPACT),
    p("compact-and-sub", "[2004Name]", "[2004sub1]\nParameterName=First\nDataType=0x0005\nAccessType=rw\n\n[2004Name]",
      _COMPACT),
    more("table-without-compact", "[2002Name]\nNrOfEntries=1\n1=First\n"),
    Planted("compact-count", without("1A00") + "[1A00]\nParameterName=Mapping\nObjectType=0x9\nDataType=0x0007\n"
            "AccessType=rw\nCompactSubObj=2\nPDOMapping=0\n", "[1A00]"),
)  # fmt: skip
_R = record("2003", "Valve", ("Highest sub-index", 5, "ro", "2"), ("Open", 1, "rw", "1"), ("Opened", 7, "ro", "2"))
OBJECTS = (
    p("no-name", "ParameterName=Target\n", "", "[2000]\n"),
    p("long-name", "ParameterName=Target", f"ParameterName={'T' * 242}", twin=f"ParameterName={'T' * 241}"),
    p("same-name", "ParameterName=Point 2", "ParameterName=point  1"),
    p("no-data-type", _TYPED, "AccessType=rw", "[2000]\n"),
    s("implied-data-type", "1017", "DataType=0x0006\n", "", "[1017]"),
    p("unknown-data-type", _TYPED, _TYPED.replace("0003", "0020"), "DataType=0x0020"),
    p("missing-deftype", _TYPED, _TYPED.replace("0003", "0040"), "DataType=0x0040"),
    s("access-type", "2000", "AccessType=rw", "AccessType=maybe"),
    s("object-type", "2000", "ObjectType=0x7", "ObjectType=0x3"),
    s("no-object-type", "2003", "ObjectType=0x9\n", "", "[2003]"),
    s("sub-indices-of-var", "2003", "ObjectType=0x9", "ObjectType=0x7"),
    Planted("no-parent", changed(section("2003"), ""), "[2003sub0]"),
    Planted("sub-before-parent", changed(section("2003") + section("2003sub0"), section("2003sub0") + section("2003")),
            "[2003sub0]"),
    Planted("no-sub-indices", changed(_R, section("2003")), "[2003]"),
    s("sub-number", "2003", "SubNumber=3", "SubNumber=4"),
    s("no-sub-number", "2003", "SubNumber=3\n", "", "[2003]"),
    s("highest-sub-index", "2003sub0", "DefaultValue=2", "DefaultValue=3"),
    Planted("no-sub-index-0", changed(section("2003sub0"), ""), "[2003]"),
    s("sub-index-0-type", "2003sub0", "DataType=0x0005", "DataType=0x0006"),
    s("mixed-array", "2002sub2", "DataType=0x0003", "DataType=0x0004", "[2002]|Obj", said="INTEGER16 and"),
    Planted("array-gap", changed(section("2002sub1"), ""), "[2002]"),
    p("object-flags", "HighLimit=500", "HighLimit=500\nObjFlags=4", "ObjFlags=4", twin="HighLimit=500\nObjFlags=3"),
    more("reserved-index", var("100B", "Node-ID", 5, "ro", "1")),
)  # fmt: skip
VALUES = (
    p("default-outside-limits", "HighLimit=500", "HighLimit=99", "DefaultValue=100\nPDOMapping=0\nLowLimit",
      twin="HighLimit=100", said="above HighLimit 99"),
    p("one-limit", "\nHighLimit=500", "", "LowLimit=-500"),
    s("node-id-overflow", "1801sub1", "DefaultValue=$NODEID+0x80000280", "DefaultValue=$NODEID+0xFFFFFF90",
      twin="DefaultValue=$NODEID+0xBFFFFF80"),
    s("constant-without-value", "1008", "DefaultValue=Pump\n", "", "[1008]"),
    p("parameter-value-in-eds", "HighLimit=500", "HighLimit=500\nParameterValue=7", "ParameterValue=7"),
)  # fmt: skip
#: More faults of rules with several.
OTHERS = (
    s("standard-read-only", "1010sub1", "AccessType=rw", "AccessType=const"),
    s("sdo-can-id", "1200sub1", "DefaultValue=$NODEID+0x600", "DefaultValue=0x601", said="$NODEID+0x600"),
    s("mappable-parameter", "1017", "PDOMapping=0", "PDOMapping=1"),
    s("mappable-parameter", "1018sub1", "PDOMapping=0", "PDOMapping=1"),
)
STANDARD = (
    Planted("mandatory-object", without("1001"), "[MandatoryObjects]", said="1001"),
    Planted("vendor-id-object", changed(section("1018sub1"), ""), "[1018]"),
    s("standard-type", "1001", "DataType=0x0005", "DataType=0x0006"),
    s("standard-kind", "1017", "DataType=0x0006", "DataType=0x0003"),
    s("standard-access", "1000", "AccessType=ro", "AccessType=rw", twin="AccessType=const"),
    s("standard-read-only", "1017", "AccessType=rw", "AccessType=ro", twin="AccessType=const"),
    Planted("standard-object-type", without("1005") + record("1005", "SYNC", ("n", 5, "const", "0")),
            "ObjectType=0x9\nSubNumber=1\n"),
    s("array-or-record", "1010", "ObjectType=0x8", "ObjectType=0x9"),
    Planted("no-error-control", without("1017"), "[OptionalObjects]"),
    more("half-guarding", var("100C", "Guard time", 6, "rw", "0"), twin=var("100C", "Guard time", 6, "rw", "0")
         + var("100D", "Life time factor", 5, "rw", "0")),
    s("service-can-id", "1005", "DefaultValue=0x00000080", "DefaultValue=0x00000581", twin="DefaultValue=0x00000081"),
    s("sync-without-period", "1005", "DefaultValue=0x00000080", "DefaultValue=0x40000080"),
    more("sync-counter", var("1019", "SYNC counter", 5, "rw", "241"), "DefaultValue=241",
         twin=var("1019", "SYNC counter", 5, "rw", "240")),
    s("sdo-can-id", "1200sub2", "DefaultValue=$NODEID+0x580", "DefaultValue=$NODEID+0x500"),
    more("reserved-sub-index", var("1800sub4", "Reserved", 5, "rw", "0")),
    s("base-cob-id", "1800sub1", "DefaultValue=$NODEID+0x180", "DefaultValue=0x280", said="$NODEID+0x180"),
    s("fixed-cob-id", "1014", "DefaultValue=$NODEID+0x80", "DefaultValue=0x81", twin="DefaultValue=0x80000081"),
    Planted("store-without-restore", without("1011"), "[1010]"),
    s("profile-objects", "1000", "DefaultValue=0x00030191", "DefaultValue=0x00020192", said="6040 and 6041"),
)  # fmt: skip
MAPPABILITY = (
    Planted("mappability-unknown", SOUND.replace("PDOMapping=0\n", "").replace("PDOMapping=1\n", "")),
    s("unmappable-type", "2001", "PDOMapping=0", "PDOMapping=1"),
    Planted(
        "mappable-parameter",
        in_section("1800sub5", "PDOMapping=0", "PDOMapping=1"),
        "[1800sub5]|PDOMapping=1",
        in_section("1200sub1", "PDOMapping=0", "PDOMapping=1"),
    ),
    s("mappable-count", "2003sub0", "PDOMapping=0", "PDOMapping=1"),
    s("mappable-constant", "6000", "AccessType=ro", "AccessType=const", "PDOMapping=1"),
    s("process-access", "2000", "AccessType=rw", "AccessType=rwr"),
    s("bits-below-granularity", "2003sub1", "PDOMapping=0", "PDOMapping=1"),
)
PDOS = (
    Planted("half-pdo", without("1A01"), "[1801]", said="1A01"),
    Planted("no-cob-id", changed(section("1801sub1"), ""), "[1801]"),
    Planted("no-transmission-type", changed(section("1801sub2"), ""), "[1801]"),
    s("unknown-cob-id", "1801sub1", "DefaultValue=$NODEID+0x80000280\n", "", "[1801sub1]"),
    s("unknown-count", "1A00sub0", "DefaultValue=2\n", "", "[1A00sub0]"),
    Planted("mapped-twice", in_section("1A00sub2", "DefaultValue=0x60010010", "DefaultValue=0x60000008"),
            "[1A00sub2]|DefaultValue="),
    s("count-over-entries", "1A00sub0", "DefaultValue=2", "DefaultValue=5"),
    s("empty-entry", "1A00sub0", "DefaultValue=2", "DefaultValue=3", "[1A00sub3]|DefaultValue=0x00000000"),
    s("unknown-entry", "1A00sub2", "DefaultValue=0x60010010\n", "", "[1A00sub2]"),
    s("enabled-and-empty", "1A00sub0", "DefaultValue=2", "DefaultValue=0", "[1800sub1]|DefaultValue="),
    s("fixed-pdo", "1A00sub2", "AccessType=rw", "AccessType=ro", "[1A00]"),
    s("cob-id-fixed", "1801sub1", "AccessType=rw", "AccessType=ro"),
    Planted("synchronous-without-sync", without("1005", in_section("1800sub2", "DefaultValue=255", "DefaultValue=1")),
            "[1800sub2]|DefaultValue=1"),
    Planted("timer-below-inhibit", in_section("1800sub3", "DefaultValue=0", "DefaultValue=101",
            in_section("1800sub5", "DefaultValue=0", "DefaultValue=10")), "[1800sub5]|DefaultValue=10",
            in_section("1800sub3", "DefaultValue=0", "DefaultValue=100",
                       in_section("1800sub5", "DefaultValue=0", "DefaultValue=10"))),
    s("default-cob-id", "1800sub1", "DefaultValue=$NODEID+0x180", "DefaultValue=$NODEID+0x190"),
)  # fmt: skip


def tpdo(rule: str, word: str, twin: str = "", at: str = "1A00sub1", said: str = "") -> Planted:
    """A fault in what TPDO1 maps first."""
    return s(rule, "1A00sub1", "0x60000008", word, f"[{at}]|DefaultValue=", twin, said)


def rpdo(rule: str, word: str, twin: str = "", at: str = "1600sub1", said: str = "") -> Planted:
    """A fault in what RPDO1 maps first."""
    return s(rule, "1600sub1", "0x62000008", word, f"[{at}]|DefaultValue=", twin, said)


MAPPED = (
    tpdo("object-exists", "0x60090008", said="6009"),
    rpdo("direction", "0x60000008", said="ro"),
    tpdo("mappable", "0x20000010", said="PDOMapping=0"),
    tpdo("read-write-object", "0x62000008", said="rww"),
    tpdo("entry-length", "0x60000010", said="8 bits, 16"),
    Planted("granularity", in_section("2003sub1", "PDOMapping=0", "PDOMapping=1",
            in_section("1A00sub1", "0x60000008", "0x20030101")), "[1A00sub1]|DefaultValue="),
    Planted("pdo-length", in_section("1A00sub0", "DefaultValue=2", "DefaultValue=3",
            in_section("1A00sub1", "0x60000008", "0x60020020",
            in_section("1A00sub3", "0x00000000", "0x60020020"))), "[1A00sub0]|DefaultValue="),
    tpdo("dummy-direction", "0x00050008"),
    rpdo("dummy-supported", "0x00020008", twin="0x00050008"),
    rpdo("dummy-length", "0x00050010"),
    Planted("double-target", in_section("1600sub0", "DefaultValue=1", "DefaultValue=2",
            in_section("1600sub2", "0x00000000", "0x62000008")), "[1600sub2]|DefaultValue="),
    s("mpdo", "1A00sub0", "DefaultValue=2", "DefaultValue=0xFE", "[1A00sub0]|DefaultValue="),
    s("transmission-type", "1800sub2", "DefaultValue=255", "DefaultValue=245", twin="DefaultValue=240"),
    s("can-id-length", "1800sub1", "DefaultValue=$NODEID+0x180", "DefaultValue=0x800"),
    s("can-id-restricted", "1800sub1", "DefaultValue=$NODEID+0x180", "DefaultValue=$NODEID+0x580"),
    s("can-id-in-use", "1800sub1", "DefaultValue=$NODEID+0x180", "DefaultValue=0x80"),
    s("can-id-elsewhere", "1800sub1", "DefaultValue=$NODEID+0x180", "DefaultValue=0x100"),
    Planted("several-writers", SECOND_RPDO, "[1601sub1]|DefaultValue=",
            UNMAPPED_RPDO, said="RPDO1"),
    s("can-id-clash", "1400sub1", "DefaultValue=$NODEID+0x200", "DefaultValue=$NODEID+0x180"),
)  # fmt: skip
_VALUE = "HighLimit=500\nParameterValue="
COMMISSIONING = (
    dcf("node-id", "NodeID=5", "NodeID=128"),
    dcf("no-node-id", "NodeID=5", "NodeID=255"),
    dcf("value-outside-limits", "HighLimit=500", f"{_VALUE}501", "ParameterValue=501"),
    Planted("value-of-read-only", in_section("6000", "PDOMapping=1", "PDOMapping=1\nParameterValue=9", DCF),
            "ParameterValue=9", DCF, "pump.dcf"),
    Planted("commissioning-in-eds", HEAD + COMMISSIONED + SOUND[len(HEAD) :], "[DeviceComissioning]"),
    Planted("unknown-module", SOUND + "\n[SupportedModules]\nNrOfEntries=1\n\n[M1ModuleInfo]\nProductName=8 DI\n"
            "ProductVersion=1\nProductRevision=0\nOrderCode=DI8\n\n[ConnectedModules]\nNrOfEntries=2\n1=1\n2=2\n",
            "[ConnectedModules]"),
    dcf("no-commissioning", "NodeID=5\n", "", "[DeviceComissioning]"),
    dcf("commissioning-spelling", "[DeviceComissioning]", "[DeviceCommissioning]"),
    dcf("commissioned-bit-rate", "Baudrate=500", "Baudrate=250"),
)  # fmt: skip
PLANTED = (
    *LINES, *FILE_INFO, *DEVICE_INFO, *LISTS, *COMPACT, *OBJECTS, *VALUES, *STANDARD, *MAPPABILITY, *PDOS, *MAPPED,
    *COMMISSIONING,
)  # fmt: skip
