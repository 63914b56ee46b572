"""The SDO channel of a device of a given family, with what is odd about it taken away. Knows behaviours, no family."""

from __future__ import annotations

from dvtcli.domain.ports import SdoTransport
from dvtcli.domain.profile import DeviceProfile


def in_standard_order(channel: SdoTransport, profile: DeviceProfile) -> SdoTransport:
    """*channel* so that entries and counts mean what CiA 301 says, whatever a device of *profile* makes of them."""
    if profile.reversed_entries:
        from dvtcli.device.quirks.reversed_entries import ReversedEntries

        channel = ReversedEntries(channel)
    if profile.filler is not None:
        from dvtcli.device.quirks.fixed_count import FixedCount

        channel = FixedCount(channel, profile.filler)
    return channel
