"""A device's file, read, written as an EDS, as an XDD, and as one from the other, and read again: nothing is lost."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from dvtcli.domain.object_dictionary import ObjectDictionary
from dvtcli.files.carried_over import DictionaryDifference, differences
from dvtcli.files.device_file import device_file_bytes, parse_device_file, read_device_file

WHEN = datetime(2026, 1, 2, 3, 4)
#: The formats that a dictionary goes through, one after the other.
WAYS = (("dcf",), ("xdc",), ("xdc", "dcf"), ("dcf", "xdc"))


@dataclass(frozen=True)
class RoundTrip:
    """A file's objects and entries, and what each way lost."""

    name: str
    objects: int
    entries: int
    lost: dict[str, list[DictionaryDifference]]

    @property
    def wrong(self) -> int:
        return sum(map(len, self.lost.values()))

    def __str__(self) -> str:
        runners = ", ".join(f"{way} {len(lost)} lost" for way, lost in self.lost.items())
        return f"{self.name:42} {self.objects:5} objects {self.entries:6} entries: {runners}"


def travelled(dictionary: ObjectDictionary, way: tuple[str, ...]) -> ObjectDictionary:
    """*dictionary* after it was written and read in each format of *way*."""
    for suffix in way:
        name = f"device.{suffix}"
        dictionary = parse_device_file(device_file_bytes(dictionary, name, "made for a test", WHEN), name).dictionary
    return dictionary


def round_trip(path: Path) -> RoundTrip:
    """What becomes of the file at *path*."""
    held = read_device_file(path).dictionary
    lost = {" → ".join(way): list(differences(held, travelled(held, way))) for way in WAYS}
    return RoundTrip(path.name, len(held), sum(1 for _ in held.entries()), lost)


def report(paths: list[Path]) -> int:
    """Print what becomes of each of *paths*, and of all; how much was lost."""
    trips: list[RoundTrip] = []
    for path in paths:
        trips.append(round_trip(path))
        print(trips[-1], flush=True)
        for line in _losses(trips[-1]):
            print(line)
    wrong = sum(trip.wrong for trip in trips)
    objects, entries = sum(trip.objects for trip in trips), sum(trip.entries for trip in trips)
    print(f"{len(trips)} files, {objects} objects, {entries} entries, {len(WAYS)} ways each: {wrong} lost")
    return wrong


def _losses(trip: RoundTrip) -> Iterator[str]:
    for way, lost in trip.lost.items():
        yield from (f"    {way}: {one}" for one in lost[:10])
