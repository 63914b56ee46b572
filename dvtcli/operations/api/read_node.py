"""What a program can ask of one node: as its commands, as methods. Changes nothing on it, and prints nothing."""

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

T = TypeVar("T")


class ReadNode:
    """A node that is asked; `Node` has what changes it, too."""

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
        """What the node says of itself: device type, identity (0x1018), name, NMT state."""
        from dvtcli.operations.nodes.find_nodes import identify

        return self._read(lambda node: identify(self._calls.session, node.node_id)).rows[0]

    def pdos(self) -> PdoListing:
        """Every PDO as the node holds it now: a list of rows, of which `["tpdo1"]` is one, too."""
        from dvtcli.operations.pdos.list_pdos import list_pdos

        return self._read(lambda node: list_pdos(self._calls.session, node.node_id, show_all=True))

    def pdo(self, pdo: str | Pdo) -> PdoRow:
        """One PDO as the node holds it now; UsageError where it has none of that name (`tpdo1`)."""
        from dvtcli.operations.pdos.list_pdos import show_pdo

        wanted = pdo_of(pdo)
        return self._read(lambda node: show_pdo(self._calls.session, wanted, node.node_id)).rows[0]

    def read(self, object_: Object, as_type: str | None = None) -> ValueRead:
        """Read an object by SDO upload, decoded as *as_type* (`u16`, `i32`, `r32`, `vs`, …) or as the EDS says."""
        from dvtcli.operations.meanings.object_values import value_result

        def read(node: DeviceNode) -> ValueRead:
            index, sub_index = object_of(node, object_)
            return value_result(node, index, sub_index, node.upload(index, sub_index), type_named(as_type))

        return self._read(read)

    def record(self, object_: Object, as_type: str | None = None) -> RecordRead:
        """Read a record or an array (`1018`) with all its sub-indices, each as *as_type* or as the EDS says.

        An entry that the node refuses is among them, with its abort code. UsageError where it is a single value.
        """
        from dvtcli.operations.objects.read_record import record_at

        return self._read(lambda node: record_at(node, object_of(node, object_)[0], type_named(as_type)))

    def faults(self) -> Faults:
        """The node's errors in words: its error register, its history, the EMCY messages heard so far; a list of rows.

        Of a family's own list each position is chosen by a write, and what was chosen before is put back.
        """
        from dvtcli.operations.nodes.show_faults import show_faults

        return self._read(lambda node: show_faults(self._calls.session, node.node_id))

    def objects(self, text: str | None = None, *, mappable: Literal["tpdo", "rpdo"] | None = None) -> ObjectListing:
        """The objects of the node's EDS whose number or name contains *text*, None for all; a list of rows.

        *mappable* leaves those that such a PDO can take. UsageError where the node has no EDS here.
        """
        from dvtcli.operations.objects.search_objects import search_objects

        if text is not None:
            word("text", text, "a part of a number or a name, such as 'velocity' or '6C01'")
        if mappable not in (None, "tpdo", "rpdo"):
            raise UsageError(f"mappable={mappable!r}: 'tpdo' or 'rpdo'")
        return self._read(lambda node: search_objects(self._calls.session, text, mappable, node.node_id))

    def vpdo(self, group: str | None = None) -> VpdoListing:
        """What each pin of *group* is tied to inside the node (`digital-in`, `motor`, …), None for all groups.

        UsageError where the node has no such group, DvtcliError where it has no virtual PDOs.
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
        """Raise SafetyRefusal unless the identity (0x1018) that is read of the node is the one given; each 32 bits."""
        from dvtcli.operations.nodes.required_identity import require_identity

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
        """Everything that the node's PDOs hold, as the text of a script that `dvtcli run` takes: a backup.

        `Bus.script` has what this program changed.
        """
        from dvtcli.operations.session.save_script import script_of

        return self._read(lambda node: script_of(self._calls.session, node.node_id))

    def verify(
        self, *pdos: str | Pdo, file: str | Path | None = None, frame: bool = False, yes: bool = False
    ) -> Compared:
        """Read PDOs back and compare with what this program set, or with *file* (DCF or EDS); true where all is equal.

        With *frame* the node is started for a moment (which needs *yes*) and a frame of each enabled TPDO looked at.
        UsageError where there is nothing to compare.
        """
        from dvtcli.operations.whole_device.compare_pdos import compare_node

        flags(frame=frame)
        wanted, against = [pdo_of(pdo) for pdo in pdos], None if file is None else str(path("file", file))
        return self._read(lambda node: compare_node(self._calls.session, node, wanted, against, frame=frame), yes=yes)

    def backup(self, file: str | Path, *, twice: bool = False, yes: bool = False) -> tuple[str, ...]:
        """Read every object of the node and keep what it holds in *file*, a `.dcf` or, also without an EDS, a `.jsonl`.

        The answer names what could not be read. *twice* as for `export`. Writing over a file needs *yes*. UsageError
        for another suffix.
        """
        from dvtcli.operations.whole_device.backup_device import backup_device

        flags(twice=twice)
        chosen = str(path("file", file))
        done = self._read(lambda node: backup_device(self._calls.session, chosen, node.node_id, twice=twice), yes=yes)
        return tuple(entry["object"] for entry in dict(done.rows)["left_out"])

    def compare(self, file: str | Path) -> WholeCompared:
        """Compare the node's settings with a DCF, EDS, XDD, XDC or a backup; true where all is equal."""
        from dvtcli.operations.whole_device.compare_device import compare_device

        name = str(path("file", file))
        return self._read(lambda node: compare_device(self._calls.session, name, node_id=node.node_id))

    def canopen(self) -> RemoteNode:
        """canopen's RemoteNode of this node, on the same bus and with the same EDS; the same one every time.

        Its SDO waits for calls of this API, and they for it. What it writes is neither checked nor put back, so look at
        it with `pdos` or `verify`. It hears frames until the bus is closed.
        """
        return self._canopen(self._node_id)

    def export(self, file: str | Path, *, twice: bool = False, yes: bool = False) -> tuple[str, ...]:
        """Write the node, as it is now, to *file*: its PDOs (.yaml), or its EDS with all configuration (.dcf).

        The answer names what is not in the file, since it could not be read or is no whole PDO. *twice* reads each
        object of a DCF two times, and leaves out what changed meanwhile. Writing over a file needs *yes*. UsageError
        for another suffix, or where the file cannot be written.
        """
        from dvtcli.operations.exports.export_file import export_file, is_of_all_nodes

        flags(twice=twice)
        chosen = str(path("file", file))
        if is_of_all_nodes(chosen):
            raise UsageError(f"{chosen} is of all nodes", hint="bus.export() writes it")
        done = self._read(lambda node: export_file(self._calls.session, chosen, node.node_id, twice=twice), yes=yes)
        left_out = dict(done.rows)["left_out"]
        return tuple(entry["object"] if isinstance(entry, dict) else entry for entry in left_out)

    def _read(self, work: Callable[[DeviceNode], T], *, yes: bool = False) -> T:
        return self._calls.run(lambda: work(self._calls.session.node(self._node_id)), yes=yes)
