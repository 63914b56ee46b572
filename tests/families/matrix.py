"""Every configuration on every simulated family: taken, refused beforehand, or aborted by the device.

An abort is what dvtcli is there to prevent: a rule could have foreseen it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

from dvtcli.simulator.network.family_file import family_names
from tests.cli.commands.bench import Bench

#: The notes' worked examples, and what lies just inside and just outside of what families allow.
CONFIGURATIONS = {
    "AN076 4.1": "map rpdo3 607A/32 2703:1/32",
    "AN076 4.2": "map tpdo1 6041/16 6061/8 6064/32",
    "Sevcon 3": "map tpdo1 6C01:1/16 606C/32 6041/16 --cob-id 0x201 --type 1 --inhibit 0 --timer 0",
    "Sevcon 4": "map rpdo1 dummy/16 2020:4/32 2020:2/16 --cob-id 0x201 --type 255",
    "RoboteQ": "map tpdo1 2100:1/16 2100:2/16 210D:1/16 210F:1/8",
    "ByteMe out": "map tpdo1 6401:1/16 6401:2/16 6000:1/8",
    "ByteMe in": "map rpdo1 3000:1/16 3000:2/16 3001:1/8",
    "statusword": "map tpdo1 6041",
    "statusword, every SYNC": "map tpdo1 6041 --sync 1 --cob-id 0x2A0",
    "statusword, 10th SYNC": "map tpdo2 6041 --sync 10",
    "controlword": "map rpdo1 6040 --cob-id 0x2A0 --event",
    "4 entries": "map tpdo1 6041 6041 6041 6041",
    "5 bytes in 5 entries": "map tpdo1 1001 1001 1001 1001 1001",
    "9 entries": f"map tpdo1{' 1001' * 9}",
    "80 bits": "map tpdo1 6041 6041 6041 6041 6041",
    "1 bit": "map rpdo1 2121/1",
    "half an object": "map tpdo1 6041/8",
    "too long an entry": "map tpdo1 6041/32",
    "64-bit entry": "map tpdo1 6041/64",
    "no such object": "map tpdo1 5FFE:1/16",
    "not mappable": "map tpdo1 1018:1",
    "wrong direction": "map rpdo1 6041",
    "read/write object": "map tpdo1 60FF",
    "application input": "map tpdo1 2220",
    "dummy in a TPDO": "map tpdo1 dummy/8 6041",
    "dummy of 8 bits": "map rpdo1 dummy/8 6040",
    "dummy of 32 bits": "map rpdo1 dummy/32 6040",
    "type 0": "set tpdo1 --type 0",
    "type 240": "set tpdo1 --type 240",
    "type 241": "set tpdo1 --type 241",
    "type 252": "set tpdo1 --type 252",
    "type 252 of an RPDO": "set rpdo1 --type 252",
    "type 254": "set tpdo1 --type 254",
    "inhibit 3276.8 ms": "set tpdo1 --inhibit 3276.8",
    "timer 32768 ms": "set tpdo1 --timer 32768",
    "timer of an RPDO": "set rpdo1 --timer 10",
    "SYNC start": "set tpdo1 --sync-start 3",
    "29 bits": "set tpdo1 --cob-id 0x18000 --extended",
    "RTR allowed": "set tpdo1 --rtr",
    "no RTR": "set tpdo1 --no-rtr",
    "no RTR on an RPDO": "set rpdo1 --no-rtr",
    "restricted CAN-ID": "set tpdo1 --cob-id 0x601",
    "CAN-ID in use": "set tpdo1 --cob-id 0x080",
    "the last PDO": "set tpdo9 --type 1",
    "no such PDO": "set tpdo40 --type 1",
    "empty and enabled": "enable tpdo3",
    "disabled": "disable tpdo1",
    "cleared": "clear tpdo1",
}
#: what no family takes
NOWHERE = frozenset({
    "9 entries", "80 bits", "half an object", "too long an entry", "64-bit entry", "no such object", "not mappable",
    "wrong direction", "dummy in a TPDO", "type 241", "type 252 of an RPDO", "no such PDO",
})  # fmt: skip
TAKEN, REFUSED, ABORTED = "taken", "refused", "ABORTED"
#: what an error document says where it was found out before anything was written
_BEFOREHAND = ("rules", "usage")


@dataclass(frozen=True)
class Cell:
    """What became of a configuration on a family; *frames* are the PDO's mapping and CAN-ID where it was taken."""

    family: str
    name: str
    outcome: str
    why: str = ""
    frames: tuple[Any, ...] = ()


def cells(names: Iterable[str] = CONFIGURATIONS) -> Iterator[Cell]:
    """The configurations of *names* on every family, each on a node of its own."""
    return (cell(family, name) for family in family_names() for name in names)


def cell(family: str, name: str) -> Cell:
    """What becomes of the configuration *name* on a node of *family*."""
    line = CONFIGURATIONS[name]
    with Bench((family,)) as bench:
        ran = bench.run(f"{line} --json")
        assert ran.code in (0, 1, 2), (family, line, ran.stdout, ran.stderr)
        document = ran.document
        if ran.code == 0:
            (row,) = bench.run(f"pdo {line.split()[1]} --json").document["pdos"]
            kept = tuple((_what(entry["object"]), entry["bits"], entry["start_bit"]) for entry in row["mapping"])
            return Cell(family, name, TAKEN, frames=(kept, row["enabled"], row["transmission_type"]))
        found = [finding["rule"] for finding in document.get("findings", ()) if finding["severity"] == "error"]
        why = found[0] if found else document["text"]
        is_absent = " has no " in document["text"]  # the read of a PDO that the device lacks is refused, no write
        beforehand = (document["error"] in _BEFOREHAND or is_absent) and document["state"] == "unchanged"
        return Cell(family, name, REFUSED if beforehand else ABORTED, why)


def _what(word: str) -> str:
    """The object; any dummy is a skip, since families have dummies of their own."""
    return "skipped" if int(word[:4], 16) < 8 else word


def table(found: list[Cell]) -> Iterator[str]:
    """One row a configuration, one column a family: `taken`, or the rule that refused it."""
    families = list(dict.fromkeys(cell.family for cell in found))
    width = max(map(len, CONFIGURATIONS)) + 2
    yield " " * width + "".join(f"{family:<20}" for family in families).rstrip()
    for name in dict.fromkeys(cell.name for cell in found):
        row = [cell for cell in found if cell.name == name]
        words = (cell.outcome if cell.outcome != REFUSED else cell.why[:18] for cell in row)
        yield f"{name:<{width}}" + "".join(f"{word:<20}" for word in words).rstrip()
    aborted = sum(cell.outcome == ABORTED for cell in found)
    taken = sum(cell.outcome == TAKEN for cell in found)
    yield f"{len(found)} cells: {taken} taken, {len(found) - taken - aborted} refused beforehand, {aborted} aborted"
