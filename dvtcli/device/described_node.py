"""An object dictionary with the interface of a node, to read a file like a device. Reads neither device nor file."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace

from dvtcli.domain.abort import Abort
from dvtcli.domain.object_dictionary import ObjectDictionary, OdEntry
from dvtcli.domain.pdo import Pdo
from dvtcli.errors import SdoAborted

#: The COB-ID of a PDO that does not exist (CiA 301, 7.5.2.35: bit 31).
_OFF = bytes([0, 0, 0, 0x80])


class KnownValues(ABC):
    """The values of one node in a file, with the interface of a node."""

    __slots__ = ()

    @abstractmethod
    def known_value(self, index: int, sub_index: int) -> bytes:
        """The value in the file. Raises SdoAborted if missing."""

    def upload(
        self,
        index: int,
        sub_index: int,
        *,
        timeout_s: float | None = None,  # noqa: ARG002 - a file answers at once
        retries: int | None = None,  # noqa: ARG002
    ) -> bytes:
        """The value in the file. Raises SdoAborted like `known_value`."""
        return self.known_value(index, sub_index)


@dataclass(frozen=True, slots=True)
class FileValues(KnownValues):
    """The values of node *node_id* according to *dictionary*: ParameterValue, else DefaultValue.

    Otherwise the standard's default, or zeros. A PDO without a COB-ID in the file is disabled.
    """

    dictionary: ObjectDictionary
    node_id: int

    def known_value(self, index: int, sub_index: int) -> bytes:
        """The value in the file. Raises SdoAborted if the file lacks the object or its value."""
        entry = self.dictionary.entry(index, sub_index)
        value = None if entry is None else self._of_entry(entry)
        if value is None:
            code = Abort.NO_SUB_INDEX if index in self.dictionary else Abort.NO_OBJECT
            raise SdoAborted(index, sub_index, code, node=self.node_id)
        return value

    def download(self, index: int, sub_index: int, data: bytes, *, timeout_s: float | None = None) -> None:  # noqa: ARG002
        """Refuse: a file's values are read-only here."""
        raise SdoAborted(index, sub_index, Abort.READ_ONLY, node=self.node_id)

    def _of_entry(self, entry: OdEntry) -> bytes | None:
        value = entry.at_power_on(self.node_id)
        data = value if value is not None else bytes((entry.data_type and entry.data_type.size) or 1)
        return _OFF if _is_no_cob_id(entry, data) else data


@dataclass(frozen=True, slots=True)
class Defaults(FileValues):
    """The factory values of node *node_id* according to *dictionary*: DefaultValue, with the node-ID."""

    def _of_entry(self, entry: OdEntry) -> bytes | None:
        data = replace(entry, value=None).initial(self.node_id)
        return None if data is not None and _is_no_cob_id(entry, data) else data


def _is_no_cob_id(entry: OdEntry, data: bytes) -> bool:
    """True if the file enables a PDO with CAN-ID 0x000 (NMT), meaning that its COB-ID is not given."""
    pdo = Pdo.at(entry.index)
    is_cob_id = pdo is not None and (entry.index, entry.sub_index) == (pdo.communication_index, 1)
    return is_cob_id and len(data) == len(_OFF) and not any(data)
