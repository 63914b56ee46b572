"""A node to read for a program: the commands that change nothing as methods. Prints nothing."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Literal, TypeVar

from dvtcli.errors import UsageError
from dvtcli.operations.api.arguments import Object, object_of, pdo_of
from dvtcli.operations.api.arguments import type_of as type_named
from dvtcli.operations.api.checks import flags, path, whole, word

if TYPE_CHECKING:
    from pathlib import Path

    from canopen import RemoteNode

    from dvtcli.device.node import Node as DeviceNode
    from dvtcli.domain.pdo import Pdo
    from dvtcli.operations.api.calls import Calls
    from dvtcli.operations.results import (
        Compared,
        Faults,
        NodeRow,
        ObjectListing,
        PdoListing,
        PdoRow,
        RecordRead,
        ValueRead,
        VpdoListing,
        WholeCompared,
    )


class ReadNode:
    """A node to read; `Node` adds changes."""

    def __init__(self, calls: Calls, node_id: int, canopen: Callable[[int], RemoteNode]) -> None:
        self._calls = calls
        self._canopen = canopen
        self._node_id = node_id

    @property
    def node_id(self) -> int:
        """The node-ID, 1…127."""
        return self._node_id

    def __repr__(self) -> str:
        return f"<dvtcli node {self._node_id}>"

    def identity(self) -> NodeRow:
        """Identify the node: device type, identity (0x1018), name, NMT state."""
        from dvtcli.operations.nodes.find_nodes import identify

        return self._read(lambda node: identify(self._calls.session, node.node_id)).rows[0]

    def pdos(self) -> PdoListing:
        """Read every PDO: a list of rows, also by name as in `["tpdo1"]`."""
        from dvtcli.operations.pdos.list_pdos import list_pdos

        return self._read(lambda node: list_pdos(self._calls.session, node.node_id, show_all=True))

    def pdo(self, pdo: str | Pdo) -> PdoRow:
        """Read a PDO; raises UsageError if the node has none of this name (`tpdo1`)."""
        from dvtcli.operations.pdos.list_pdos import show_pdo

        wanted = pdo_of(pdo)
        return self._read(lambda node: show_pdo(self._calls.session, wanted, node.node_id)).rows[0]

    def read(self, object_: Object, as_type: str | None = None) -> ValueRead:
        """Read an object by SDO upload, decoded as *as_type* (`u16`, `i32`, `r32`, `vs`, …) or the type in the EDS."""
        from dvtcli.operations.values.object_values import value_result

        def read(node: DeviceNode) -> ValueRead:
            index, sub_index = object_of(node, object_)
            return value_result(node, index, sub_index, node.upload(index, sub_index), type_named(as_type))

        return self._read(read)

    def record(self, object_: Object, as_type: str | None = None) -> RecordRead:
        """Read a record or an array (`1018`) with all sub-indices, as *as_type* or the types in the EDS.

        A refused entry is included, with its abort code. Raises UsageError for a single value.
        """
        from dvtcli.operations.objects.read_record import record_at

        return self._read(lambda node: record_at(node, object_of(node, object_)[0], type_named(as_type)))

    def faults(self) -> Faults:
        """Read the node's errors in words: error register, history, received EMCY messages; a list of rows.

        The positions of a family's own list are selected by writes, and the old selection is restored.
        """
        from dvtcli.operations.frames.show_faults import show_faults

        return self._read(lambda node: show_faults(self._calls.session, node.node_id))

    def objects(self, text: str | None = None, *, mappable: Literal["tpdo", "rpdo"] | None = None) -> ObjectListing:
        """List objects of the node's EDS with *text* in number or name, None for all; a list of rows.

        *mappable* keeps objects for such a PDO. Raises UsageError if the node has no EDS.
        """
        from dvtcli.operations.objects.search_objects import search_objects

        if text is not None:
            word("text", text, "a part of a number or a name, such as 'velocity' or '6C01'")
        if mappable not in (None, "tpdo", "rpdo"):
            raise UsageError(f"mappable={mappable!r}: 'tpdo' or 'rpdo'")
        return self._read(lambda node: search_objects(self._calls.session, text, mappable, node.node_id))

    def vpdo(self, group: str | None = None) -> VpdoListing:
        """List the objects tied to pins of *group* inside the node (`digital-in`, `motor`, …), None for all groups.

        Raises UsageError for an unknown group, DvtcliError if the node has no virtual PDOs.
        """
        from dvtcli.operations.pdos.virtual_pdo_ties import list_ties

        if group is not None:
            word("group", group, "the name of a group, such as 'digital-in'")
        return self._read(lambda node: list_ties(self._calls.session, group, node.node_id))

    def require(
        self,
        *,
        vendor_id: int | None = None,
        product_code: int | None = None,
        revision: int | None = None,
        serial: int | None = None,
    ) -> None:
        """Raises SafetyRefusal unless the node's identity (0x1018) equals the given numbers; each 32 bits."""
        from dvtcli.operations.session.consent import require_identity

        given = {"vendor": vendor_id, "product": product_code, "revision": revision, "serial": serial}
        called = {"vendor": "vendor_id", "product": "product_code"}
        wanted = [
            (name, whole(called.get(name, name), value, name, 0xFFFF_FFFF))
            for name, value in given.items()
            if value is not None
        ]
        if not wanted:
            raise UsageError("which identity? vendor_id=…, product_code=…, revision=…, serial=…")
        session = self._calls.session
        self._read(lambda node: require_identity(session, wanted, node.node_id, "this program"))

    def script(self) -> str:
        """Return all PDOs of the node as a script for `dvtcli run`: a backup.

        `Bus.script` has this program's changes.
        """
        from dvtcli.operations.session.save_script import script_of

        return self._read(lambda node: script_of(self._calls.session, node.node_id))

    def verify(
        self, *pdos: str | Pdo, file: str | Path | None = None, frame: bool = False, yes: bool = False
    ) -> Compared:
        """Read PDOs and compare them with this program's changes, or with *file* (DCF or EDS); true if equal.

        *frame* starts the node for a moment (needs *yes*) and checks a frame of each enabled TPDO. Raises UsageError if
        there is nothing to compare.
        """
        from dvtcli.operations.devices.verify_nodes import compare_node

        flags(frame=frame)
        wanted, against = [pdo_of(pdo) for pdo in pdos], None if file is None else str(path("file", file))
        return self._read(lambda node: compare_node(self._calls.session, node, wanted, against, frame=frame), yes=yes)

    def backup(self, file: str | Path, *, twice: bool = False, yes: bool = False) -> tuple[str, ...]:
        """Save every object of the node to *file*, a `.dcf` or, even without an EDS, a `.jsonl`.

        Returns unreadable objects. *twice* as for `export`. Overwriting needs *yes*. Raises UsageError for another
        suffix.
        """
        from dvtcli.operations.devices.backup_device import backup_device

        flags(twice=twice)
        chosen = str(path("file", file))
        done = self._read(lambda node: backup_device(self._calls.session, chosen, node.node_id, twice=twice), yes=yes)
        return tuple(entry["object"] for entry in dict(done.rows)["left_out"])

    def compare(self, file: str | Path) -> WholeCompared:
        """Compare the node's settings with a DCF, EDS, XDD, XDC or a backup; true if all are equal."""
        from dvtcli.operations.devices.compare_device import compare_device

        name = str(path("file", file))
        return self._read(lambda node: compare_device(self._calls.session, name, node_id=node.node_id))

    def canopen(self) -> RemoteNode:
        """Return canopen's RemoteNode of this node, on the same bus and with the same EDS; always the same object.

        Its SDO and calls of this API wait for each other. Its writes are neither checked nor rolled back, so check them
        with `pdos` or `verify`. It receives frames until the bus is closed.
        """
        return self._canopen(self._node_id)

    def export(self, file: str | Path, *, twice: bool = False, yes: bool = False) -> tuple[str, ...]:
        """Export the node to *file*: its PDOs (.yaml), or its EDS with all configuration (.dcf).

        Returns what the file lacks, unreadable or an incomplete PDO. *twice* reads each object of a DCF twice and
        leaves out changed values. Overwriting needs *yes*. Raises UsageError for another suffix, or if the file cannot
        be written.
        """
        from dvtcli.operations.exchange.export_file import export_file, is_of_all_nodes

        flags(twice=twice)
        chosen = str(path("file", file))
        if is_of_all_nodes(chosen):
            raise UsageError(f"{chosen} applies to all nodes", hint="bus.export() writes it")
        done = self._read(lambda node: export_file(self._calls.session, chosen, node.node_id, twice=twice), yes=yes)
        left_out = dict(done.rows)["left_out"]
        return tuple(entry["object"] if isinstance(entry, dict) else entry for entry in left_out)

    def _read(self, work: Callable[[DeviceNode], T], *, yes: bool = False) -> T:
        return self._calls.run(lambda: work(self._calls.session.node(self._node_id)), yes=yes)


T = TypeVar("T")
