"""An object dictionary behind the same seam as a node, so that what a file says is read the way a device is.

Reads no device and no file: the dictionary is given.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from dvtcli.domain.abort import Abort
from dvtcli.domain.object_dictionary import ObjectDictionary, OdEntry
from dvtcli.errors import SdoAborted


@dataclass(frozen=True, slots=True)
class FileValues:
    """What *dictionary* says that node *node_id* holds: ParameterValue, else DefaultValue, else zeros."""

    dictionary: ObjectDictionary
    node_id: int

    def upload(
        self,
        index: int,
        sub_index: int,
        *,
        timeout_s: float | None = None,  # noqa: ARG002 - a file answers at once
        retries: int | None = None,  # noqa: ARG002
    ) -> bytes:
        """What the file says; SdoAborted where it has no such object, or tells nothing of it."""
        entry = self.dictionary.entry(index, sub_index)
        value = None if entry is None else self._told(entry)
        if value is None:
            code = Abort.NO_SUB_INDEX if index in self.dictionary else Abort.NO_OBJECT
            raise SdoAborted(index, sub_index, code, node=self.node_id)
        return value

    def download(self, index: int, sub_index: int, data: bytes, *, timeout_s: float | None = None) -> None:  # noqa: ARG002
        """A file's values are never written here."""
        raise SdoAborted(index, sub_index, Abort.READ_ONLY, node=self.node_id)

    def _told(self, entry: OdEntry) -> bytes | None:
        value = entry.initial(self.node_id)
        return value if value is not None else bytes((entry.data_type and entry.data_type.size) or 1)


@dataclass(frozen=True, slots=True)
class Defaults(FileValues):
    """What *dictionary* says that node *node_id* holds when nothing was ever set: DefaultValue, with the node-ID."""

    def _told(self, entry: OdEntry) -> bytes | None:
        return replace(entry, value=None).initial(self.node_id)
