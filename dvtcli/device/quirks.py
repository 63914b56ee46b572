"""The SDO channel of a device family, with deviations from CiA 301 corrected."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from dvtcli.domain.pdo import Pdo, is_mpdo
from dvtcli.domain.ports import SdoTransport
from dvtcli.domain.profile import DeviceProfile


def in_standard_order(channel: SdoTransport, profile: DeviceProfile) -> SdoTransport:
    """*channel* with entries and counts as in CiA 301, whatever the deviations in *profile*."""
    if profile.reversed_entries:
        channel = ReversedEntries(channel)
    if profile.filler is not None:
        channel = FixedCount(channel, profile.filler)
    return channel


@dataclass(slots=True)
class FixedCount:
    """*inner* with the count of every PDO mapping derived from its entries; *filler* (u32) marks an unused entry."""

    inner: SdoTransport
    filler: int

    def upload(
        self, index: int, sub_index: int, *, timeout_s: float | None = None, retries: int | None = None
    ) -> bytes:
        """Read an object; the count of a mapping excludes the fillers at its end."""
        data = self.inner.upload(index, sub_index, timeout_s=timeout_s, retries=retries)
        if not _is_count(index, sub_index) or len(data) != 1 or is_mpdo(data[0]):
            return data
        used = (place for place, word in self._entries(index, range(data[0], 0, -1)) if word != self._filler)
        return bytes([next(used, 0)])

    def download(self, index: int, sub_index: int, data: bytes, *, timeout_s: float | None = None) -> None:
        """Write an object; a count turns all used entries behind it into fillers."""
        if not _is_count(index, sub_index):
            self.inner.download(index, sub_index, data, timeout_s=timeout_s)
            return
        highest = self.inner.upload(index, 0)[0]
        for place, word in self._entries(index, range(data[0] + 1, highest + 1)):
            if word != self._filler:
                self.inner.download(index, place, self._filler, timeout_s=timeout_s)

    @property
    def _filler(self) -> bytes:
        return self.filler.to_bytes(4, "little")

    def _entries(self, index: int, places: range) -> Iterator[tuple[int, bytes]]:
        return ((place, self.inner.upload(index, place)) for place in places)


def _is_count(index: int, sub_index: int) -> bool:
    pdo = Pdo.at(index)
    return sub_index == 0 and pdo is not None and index == pdo.mapping_index


@dataclass(slots=True)
class ReversedEntries:
    """*inner* with the fields of every PDO mapping entry reversed in both directions."""

    inner: SdoTransport

    def upload(
        self, index: int, sub_index: int, *, timeout_s: float | None = None, retries: int | None = None
    ) -> bytes:
        """Read an object; a mapping entry in CiA 301 order."""
        data = self.inner.upload(index, sub_index, timeout_s=timeout_s, retries=retries)
        return as_standard(data) if _is_entry(index, sub_index, data) else data

    def download(self, index: int, sub_index: int, data: bytes, *, timeout_s: float | None = None) -> None:
        """Write an object; a mapping entry in the device's order."""
        sent = as_device(data) if _is_entry(index, sub_index, data) else data
        self.inner.download(index, sub_index, sent, timeout_s=timeout_s)


def _is_entry(index: int, sub_index: int, data: bytes) -> bool:
    pdo = Pdo.at(index)
    return pdo is not None and index == pdo.mapping_index and sub_index > 0 and len(data) == 4


def as_standard(data: bytes) -> bytes:
    """The four bytes of an entry from a device: index (2), sub-index, length become length, sub-index, index (2)."""
    return bytes([data[3], data[2]]) + data[:2]


def as_device(data: bytes) -> bytes:
    """The four bytes of an entry for a device: length, sub-index, index (2) become index (2), sub-index, length."""
    return data[2:] + bytes([data[1], data[0]])
