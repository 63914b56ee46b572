"""A file's values behind the same seam as a node, so that a DCF is read the way a device is."""

from __future__ import annotations

from dataclasses import dataclass

from dvtcli.domain.abort import Abort
from dvtcli.domain.object_dictionary import ObjectDictionary
from dvtcli.errors import SdoAborted


@dataclass(frozen=True, slots=True)
class FileValues:
    """What *dictionary* says that node *node_id* holds: ParameterValue, else DefaultValue."""

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
        """The value in the file; SdoAborted where it has no such object, zeros where it gives no value."""
        entry = self.dictionary.entry(index, sub_index)
        if entry is None:
            code = Abort.NO_SUB_INDEX if index in self.dictionary else Abort.NO_OBJECT
            raise SdoAborted(index, sub_index, code, node=self.node_id)
        value = entry.initial(self.node_id)
        return value if value is not None else bytes((entry.data_type and entry.data_type.size) or 1)

    def download(self, index: int, sub_index: int, data: bytes, *, timeout_s: float | None = None) -> None:  # noqa: ARG002
        """A file's values are never written here."""
        raise SdoAborted(index, sub_index, Abort.READ_ONLY, node=self.node_id)
