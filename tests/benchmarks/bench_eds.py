"""How fast EDS files are read: `python tests/benchmarks/bench_eds.py [ROUNDS]`.

Makes an EDS of 2,000 objects and 6,000 sections, and reads it with canopen and with ours in turn, so that what else
the machine does falls on all alike. Prints medians and the median of each round's ratio to canopen.
"""

from __future__ import annotations

import logging
import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import canopen

from dvtcli.files.eds.reader import read_eds

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


def measure(path: Path, rounds: int) -> dict[str, list[float]]:
    """Seconds of each way to read *path*, *rounds* times, one after the other in every round."""

    def every_object() -> None:
        for _ in read_eds(path).dictionary.entries():
            pass

    def everything() -> None:
        eds = read_eds(path)
        list(eds.dictionary.entries())
        len(eds.findings)

    ways: dict[str, Callable[[], object]] = {
        "canopen import_od": lambda: canopen.import_od(str(path)),
        "ours, one object looked at": lambda: read_eds(path).dictionary[0x2001],
        "ours, every object built": every_object,
        "ours, built, and all findings": everything,
    }
    times: dict[str, list[float]] = {name: [] for name in ways}
    for _ in range(rounds):
        for name, read in ways.items():
            start = time.perf_counter()
            read()
            times[name].append(time.perf_counter() - start)
    return times


def main(rounds: int) -> None:
    """Measure and print the table."""
    logging.disable(logging.CRITICAL)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "bench.eds"
        path.write_text(make_eds(), encoding="utf-8")
        times = measure(path, rounds)
        size = f"{read_eds(path).sections} sections, {path.stat().st_size // 1000} kB"
        print(f"{OBJECTS} objects, {size}, {rounds} rounds")
    base = times["canopen import_od"]
    print(f"{'':32}{'median':>10}{'faster':>9}")
    for name, seconds in times.items():
        ratio = statistics.median(slow / own for slow, own in zip(base, seconds, strict=True))
        print(f"{name:32}{1000 * statistics.median(seconds):7.1f} ms{ratio:8.1f}x")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 11)
