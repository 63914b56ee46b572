"""The SDO channel of a device family, with deviations from CiA 301 corrected."""

from __future__ import annotations

from dvtcli.domain.ports import SdoTransport
from dvtcli.domain.profile import DeviceProfile


def in_standard_order(channel: SdoTransport, profile: DeviceProfile) -> SdoTransport:
    """*channel* with entries and counts as in CiA 301, whatever the deviations in *profile*."""
    if profile.reversed_entries:
        from dvtcli.device.quirks.reversed_entries import ReversedEntries

        channel = ReversedEntries(channel)
    if profile.filler is not None:
        from dvtcli.device.quirks.fixed_count import FixedCount

        channel = FixedCount(channel, profile.filler)
    return channel
