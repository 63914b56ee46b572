"""An SDO channel to a device with reversed fields in mapping entries.

Callers see CiA 301 entries (index, sub-index, length from the highest bits down); on the wire the order is length, sub-
index, index.
"""

from __future__ import annotations

from dataclasses import dataclass

from dvtcli.domain.pdo import Pdo
from dvtcli.domain.ports import SdoTransport


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
