"""Simulated devices for tests, made from the families' own files."""

from __future__ import annotations

from functools import lru_cache

from dvtcli.domain.object_dictionary import ObjectDictionary
from dvtcli.files.eds.reader import read_eds
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import family_eds, load_family


@lru_cache
def dictionary(family: str) -> ObjectDictionary:
    return read_eds(family_eds(family)).dictionary


def device(node_id: int, family: str = "generic") -> StrictDevice:
    return StrictDevice(dictionary(family), load_family(family), node_id)
