"""An object dictionary behind the same seam as a node, so that what a file says is read the way a device is.

Reads no device and no file: the dictionary is given.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace

from dvtcli.domain.abort import Abort
from dvtcli.domain.object_dictionary import ObjectDictionary, OdEntry
from dvtcli.domain.pdo import Pdo
from dvtcli.errors import SdoAborted

#: The COB-ID of a PDO that does not exist (CiA 301, 7.5.2.35: bit 31).
_OFF = bytes([0, 0, 0, 0x80])


class ToldValues(ABC):
    """What a file says of one node, behind the same seam as the node."""

    __slots__ = ()

    @abstractmethod
    def told(self, index: int, sub_index: int) -> bytes:
        """What the file says; SdoAborted where it says nothing of it."""

    def upload(
        self,
        index: int,
        sub_index: int,
        *,
        timeout_s: float | None = None,  # noqa: ARG002 - a file answers at once
        retries: int | None = None,  # noqa: ARG002
    ) -> bytes:
        """What the file says; SdoAborted as of `told`."""
        return self.told(index, sub_index)


@dataclass(frozen=True, slots=True)
class FileValues(ToldValues):
    """What *dictionary* says that node *node_id* holds: ParameterValue, else DefaultValue.

    Else the standard's default, else zeros. A PDO of which it tells no COB-ID is off.
    """

    dictionary: ObjectDictionary
    node_id: int

    def told(self, index: int, sub_index: int) -> bytes:
        """What the file says; SdoAborted where it has no such object, or tells nothing of it."""
        entry = self.dictionary.entry(index, sub_index)
        value = None if entry is None else self._of_entry(entry)
        if value is None:
            code = Abort.NO_SUB_INDEX if index in self.dictionary else Abort.NO_OBJECT
            raise SdoAborted(index, sub_index, code, node=self.node_id)
        return value

    def download(self, index: int, sub_index: int, data: bytes, *, timeout_s: float | None = None) -> None:  # noqa: ARG002
        """A file's values are never written here."""
        raise SdoAborted(index, sub_index, Abort.READ_ONLY, node=self.node_id)

    def _of_entry(self, entry: OdEntry) -> bytes | None:
        value = entry.at_power_on(self.node_id)
        told = value if value is not None else bytes((entry.data_type and entry.data_type.size) or 1)
        return _OFF if _is_no_cob_id(entry, told) else told


@dataclass(frozen=True, slots=True)
class Defaults(FileValues):
    """What *dictionary* says that node *node_id* holds when nothing was ever set: DefaultValue, with the node-ID."""

    def _of_entry(self, entry: OdEntry) -> bytes | None:
        told = replace(entry, value=None).initial(self.node_id)
        return None if told is not None and _is_no_cob_id(entry, told) else told


def _is_no_cob_id(entry: OdEntry, told: bytes) -> bool:
    """Whether a file says that a PDO is enabled with CAN-ID 0x000, which is NMT: that it does not tell its COB-ID."""
    pdo = Pdo.at(entry.index)
    is_cob_id = pdo is not None and (entry.index, entry.sub_index) == (pdo.communication_index, 1)
    return is_cob_id and len(told) == len(_OFF) and not any(told)
