"""Use canopen's node beside ours: SDO by turns; its writes invalidate our caches."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.errors import SafetyRefusal, UsageError

if TYPE_CHECKING:
    from dvtcli.operations.api.calls import Calls


class TakingTurns:
    """An SdoTransport of *node_id* for others: waits for our calls on the bus."""

    def __init__(self, calls: Calls, node_id: int) -> None:
        self._calls, self._node_id = calls, node_id

    def upload(
        self, index: int, sub_index: int, *, timeout_s: float | None = None, retries: int | None = None
    ) -> bytes:
        """Read an object."""
        with self._calls.alone():
            channel = self._calls.session.wire.sdo(self._node_id)
            return channel.upload(index, sub_index, timeout_s=timeout_s, retries=retries)

    def download(self, index: int, sub_index: int, data: bytes, *, timeout_s: float | None = None) -> None:
        """Write an object unchecked; raises SafetyRefusal if another dvtcli holds the node, UsageError in a dry run."""
        with self._calls.alone():
            session = self._calls.session
            if session.dry_run:
                raise UsageError("canopen writes to the device itself: not in a dry run")
            node = session.node(self._node_id)
            try:
                node.begin_change()
            except SafetyRefusal:
                node.forget_restart()
                raise
            try:
                session.wire.sdo(self._node_id).download(index, sub_index, data, timeout_s=timeout_s)
            finally:
                node.forget()
                node.release_lock()
