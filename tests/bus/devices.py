"""Simulated devices for tests, made from the families' own files."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

from dvtcli.domain.object_dictionary import ObjectDictionary
from dvtcli.files.eds.reader import read_eds
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import family_eds, load_family


@lru_cache
def dictionary(family: str) -> ObjectDictionary:
    """What a simulated device of *family* has: a modular device with the modules of its family."""
    return read_eds(family_eds(family), load_family(family).modules or None).dictionary


def device(node_id: int, family: str = "generic") -> StrictDevice:
    return StrictDevice(dictionary(family), load_family(family), node_id)


def unknown(node_id: int, family: str = "generic") -> StrictDevice:
    """A device like the family's with a serial number of its own, as a real one has: no EDS is known of it."""
    return StrictDevice(unknown_dictionary(family), load_family(family), node_id)


@lru_cache
def unknown_dictionary(family: str = "generic") -> ObjectDictionary:
    described = dictionary(family)
    identity = described[0x1018]
    entries = {**identity.entries, 4: replace(identity.entries[4], default=b"\x77\x00\x00\x00")}
    objects = {index: described[index] for index in described} | {0x1018: replace(identity, entries=entries)}
    return ObjectDictionary(objects, described.info, described.source)
