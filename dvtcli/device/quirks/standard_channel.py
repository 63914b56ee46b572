"""The SDO channel of a device of a given family, with what is odd about it taken away. Knows behaviours, no family."""

from __future__ import annotations

from dvtcli.device.quirks.fixed_count import FixedCount
from dvtcli.device.quirks.reversed_entries import ReversedEntries
from dvtcli.domain.ports import SdoTransport
from dvtcli.domain.profile import DeviceProfile


def in_standard_order(channel: SdoTransport, profile: DeviceProfile) -> SdoTransport:
    """*channel* so that entries and counts mean what CiA 301 says, whatever a device of *profile* makes of them."""
    if profile.reversed_entries:
        channel = ReversedEntries(channel)
    return channel if profile.filler is None else FixedCount(channel, profile.filler)
