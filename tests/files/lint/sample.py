"""A small device's file with nothing wrong in it, and what is done to it to have something wrong."""

from __future__ import annotations

from collections.abc import Iterable

from dvtcli.files.device_lint import RULES, lint
from dvtcli.files.eds.findings import EdsFinding
from dvtcli.files.eds.reader import parse_eds

NAME = "pump.eds"
EVERY = frozenset(rule.name for rule in RULES)


def var(index: str, name: str, data_type: int, access: str, default: str = "", *more: str) -> str:
    """An object of one entry."""
    lines = [f"[{index}]", f"ParameterName={name}", "ObjectType=0x7", f"DataType=0x{data_type:04X}"]
    lines += [f"AccessType={access}", *([f"DefaultValue={default}"] if default else []), "PDOMapping=0"]
    return "\n".join([*lines, *more, "", ""])


def record(index: str, name: str, *rows: tuple[str, int, str, str] | None, kind: int = 9) -> str:
    """An object of many: name, data type, access and default of each sub-index, from 0; None is a gap."""
    count = sum(row is not None for row in rows)
    text = f"[{index}]\nParameterName={name}\nObjectType=0x{kind}\nSubNumber={count}\n\n"
    for sub_index, row in enumerate(rows):
        text += "" if row is None else var(f"{index}sub{sub_index:X}", *row)
    return text


def pdo(number: int, kind: str, cob_id: str, mapped: Iterable[str], transmission_type: int = 255) -> str:
    """Communication parameter and mapping of a PDO, with room for four entries."""
    communication, mapping = ("18", "1A") if kind == "TPDO" else ("14", "16")
    words = [*mapped]
    rows = [(f"Entry {n + 1}", 7, "rw", words[n] if n < len(words) else "0x00000000") for n in range(4)]
    return record(
        f"{communication}{number - 1:02X}",
        f"{kind} {number} communication",
        ("Highest sub-index", 5, "const", "5" if kind == "TPDO" else "2"),
        ("COB-ID", 7, "rw", cob_id),
        ("Transmission type", 5, "rw", str(transmission_type)),
        *([("Inhibit time", 6, "rw", "0"), None, ("Event timer", 6, "rw", "0")]
          if kind == "TPDO" else []),
    ) + record(
        f"{mapping}{number - 1:02X}", f"{kind} {number} mapping", ("Count", 5, "rw", str(len(words))), *rows
    )  # fmt: skip


def listed(name: str, *indices: str) -> str:
    """A list of objects."""
    rows = "".join(f"{number}=0x{index}\n" for number, index in enumerate(indices, 1))
    return f"[{name}]\nSupportedObjects={len(indices)}\n{rows}\n"


_RATES = "".join(f"BaudRate_{rate}={int(rate in (125, 500))}\n" for rate in (10, 20, 50, 125, 250, 500, 800, 1000))
HEAD = f"""[FileInfo]
FileName={NAME}
FileVersion=1
FileRevision=2
EDSVersion=4.0
Description=A pump
CreationTime=09:30AM
CreationDate=01-31-2024
CreatedBy=Example
ModificationTime=10:15AM
ModificationDate=02-01-2024
ModifiedBy=Example

[DeviceInfo]
VendorName=Example
VendorNumber=0x00000ABC
ProductName=Pump
ProductNumber=0x00000001
RevisionNumber=0x00010002
OrderCode=P-1
{_RATES}SimpleBootUpMaster=0
SimpleBootUpSlave=1
Granularity=8
DynamicChannelsSupported=0
GroupMessaging=0
NrOfRXPDO=1
NrOfTXPDO=2
LSS_Supported=0

[DummyUsage]
{"".join(f"Dummy000{number}={int(number > 4)}" + chr(10) for number in range(1, 8))}
[Comments]
Lines=1
Line1=nothing to say

"""
LISTS = (
    listed("MandatoryObjects", "1000", "1001", "1018")
    + listed("OptionalObjects", "1003", "1005", "1008", "1010", "1011", "1014", "1017", "1200", "1400", "1600",
             "1800", "1801", "1A00", "1A01", "6000", "6001", "6002", "6200")
    + listed("ManufacturerObjects", "2000", "2001", "2002", "2003", "2004")
)  # fmt: skip
STANDARD = (
    var("1000", "Device type", 7, "ro", "0x00030191")
    + var("1001", "Error register", 5, "ro", "0")
    + record("1003", "Error field", ("Errors", 5, "rw", "0"), ("Last error", 7, "ro", "0"), kind=8)
    + var("1005", "COB-ID SYNC", 7, "rw", "0x00000080")
    + var("1008", "Device name", 9, "const", "Pump")
    + record("1010", "Store", ("Highest sub-index", 5, "const", "1"), ("Store all", 7, "rw", "1"), kind=8)
    + record("1011", "Restore", ("Highest sub-index", 5, "const", "1"), ("Restore all", 7, "rw", "1"), kind=8)
    + var("1014", "COB-ID EMCY", 7, "rw", "$NODEID+0x80")
    + var("1017", "Heartbeat", 6, "rw", "1000")
    + record("1018", "Identity", ("Highest sub-index", 5, "const", "3"), ("Vendor-ID", 7, "ro", "0x00000ABC"),
             ("Product code", 7, "ro", "0x00000001"), ("Revision", 7, "ro", "0x00010002"))
    + record("1200", "SDO server", ("Highest sub-index", 5, "const", "2"),
             ("Client to server", 7, "ro", "$NODEID+0x600"), ("Server to client", 7, "ro", "$NODEID+0x580"))
)  # fmt: skip
PDOS = (
    pdo(1, "RPDO", "$NODEID+0x200", ("0x62000008",))
    + pdo(1, "TPDO", "$NODEID+0x180", ("0x60000008", "0x60010010"))
    + pdo(2, "TPDO", "$NODEID+0x80000280", ("0x60020020",))
)
OWN = (
    var("6000", "Level", 5, "ro", "0").replace("PDOMapping=0", "PDOMapping=1")
    + var("6001", "Pressure", 3, "ro", "0").replace("PDOMapping=0", "PDOMapping=1")
    + var("6002", "Flow", 7, "rw", "0").replace("PDOMapping=0", "PDOMapping=1")
    + var("6200", "Valves", 5, "rww", "0").replace("PDOMapping=0", "PDOMapping=1")
    + var("2000", "Target", 3, "rw", "100", "LowLimit=-500", "HighLimit=500")
    + var("2001", "Name", 9, "rw", "pump")
    + record("2002", "Curve", ("Highest sub-index", 5, "ro", "2"), ("Point 1", 3, "rw", "1"),
             ("Point 2", 3, "rw", "2"), kind=8)
    + record("2003", "Valve", ("Highest sub-index", 5, "ro", "2"), ("Open", 1, "rw", "1"), ("Opened", 7, "ro", "2"))
    + "[2004]\nParameterName=Table\nObjectType=0x8\nDataType=0x0005\nAccessType=rw\nDefaultValue=3\nPDOMapping=0\n"
      "CompactSubObj=3\n\n[2004Name]\nNrOfEntries=1\n2=Second\n\n"
)  # fmt: skip
SOUND = HEAD + LISTS + STANDARD + PDOS + OWN
COMMISSIONED = """[DeviceComissioning]
NodeID=5
NodeName=pump
Baudrate=500
NetNumber=0
NetworkName=hall
CANopenManager=0
LSS_SerialNumber=0

"""


def found(text: str | bytes, name: str = NAME, rules: Iterable[str] = EVERY) -> tuple[EdsFinding, ...]:
    """What *rules* say of a file of *text* called *name*, with the line ends of the standard."""
    data = text if isinstance(text, bytes) else text.replace("\n", "\r\n").encode()
    return lint(parse_eds(data, name), name, set(rules))


def line_of(text: str, part: str) -> int:
    """The line of *text* where *part* begins, 1 and up."""
    assert text.count(part) == 1, (text.count(part), part)
    return text[: text.index(part)].count("\n") + 1
