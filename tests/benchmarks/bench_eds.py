"""How fast an EDS file is read, beside canopen.

    python -m tests.benchmarks eds

Makes an EDS of 2,000 objects and 6,000 sections, and reads it with canopen and with ours in turn. Each read is the
first of a process of its own, as a command's is: a process remembers what it read. Processor time of the read alone.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from tests.benchmarks.figures import ENVIRONMENT, ROOT, Figure

OBJECTS = 2_000
SUB_INDICES = 2

HEAD = """[FileInfo]
FileName=bench.eds
EDSVersion=4.0

[DeviceInfo]
VendorName=Example
VendorNumber=0x1
ProductNumber=0x2
NrOfRXPDO=4
NrOfTXPDO=4
Granularity=8

[DummyUsage]
Dummy0001=0
Dummy0002=0
Dummy0003=0
Dummy0004=0
Dummy0005=1
Dummy0006=1
Dummy0007=1

[Comments]
Lines=0
"""


def make_eds(objects: int = OBJECTS) -> str:
    """An EDS with *objects* arrays in the manufacturer's range, each of three sections with sub-indices 0 and 1."""
    listed = "".join(f"{number}=0x{0x2000 + number:04X}\n" for number in range(1, objects + 1))
    parts = [HEAD, f"\n[ManufacturerObjects]\nSupportedObjects={objects}\n{listed}"]
    parts += [_array(0x2000 + number) for number in range(1, objects + 1)]
    return "\n".join(parts)


def _array(index: int) -> str:
    sections = [f"[{index:04X}]\nParameterName=Object {index:04X}\nObjectType=0x8\nSubNumber={SUB_INDICES}\n"]
    for sub_index, data_type, access in ((0, 5, "ro"), (1, 3, "rw")):
        sections.append(
            f"[{index:04X}sub{sub_index}]\nParameterName=Element {sub_index} of {index:04X}\nObjectType=0x7\n"
            f"DataType=0x{data_type:04X}\nAccessType={access}\nLowLimit=0\nHighLimit=100\n"
            f"DefaultValue={sub_index + 1}\nPDOMapping=0\n"
        )
    return "\n".join(sections)


_READ = """
import logging, sys, time
from pathlib import Path
logging.disable(logging.CRITICAL)
{imported}
path = Path(sys.argv[1])
began = time.process_time()
{read}
print(time.process_time() - began)
"""
BY_CANOPEN = ("import canopen", "canopen.import_od(str(path))")
_OURS = "from dvtcli.files.eds.reader import read_eds"
#: name, what reads the file, goal: how many times as fast as canopen
WAYS: list[tuple[str, str, float | None]] = [
    ("one object looked at", "read_eds(path).dictionary[0x2001]", 15),
    ("every object built", "list(read_eds(path).dictionary.entries())", None),
    ("built, and all findings", "eds = read_eds(path); list(eds.dictionary.entries()); len(eds.findings)", None),
]


def read_ms(path: Path, imported: str, read: str) -> float:
    """Processor time (ms) that *read* takes for the file at *path* in a new process."""
    command = [sys.executable, "-c", _READ.format(imported=imported, read=read), str(path)]
    done = subprocess.run(command, check=True, capture_output=True, text=True, cwd=ROOT, env=ENVIRONMENT)
    return 1000 * float(done.stdout)


def figures(rounds: int) -> Iterator[Figure]:
    """Each of WAYS; the goal is to take a fraction of canopen's time."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "bench.eds"
        path.write_text(make_eds(), encoding="utf-8")
        for name, read, times in WAYS:
            pairs = [(read_ms(path, _OURS, read), read_ms(path, *BY_CANOPEN)) for _ in range(rounds)]
            own, other = zip(*pairs, strict=True)
            most = None if times is None else 1 / times
            yield Figure(f"EDS of {OBJECTS} objects, {name}", "ms", own, "canopen import_od", other, most=most)
