"""Change a node's PDOs and objects by methods like the commands. Prints and asks nothing."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Literal, TypeVar, Unpack

from dvtcli.domain.request import Cleared, Switched
from dvtcli.errors import UsageError
from dvtcli.operations.api.arguments import (
    Entry,
    Object,
    PdoOptions,
    bytes_of,
    entry_of,
    object_of,
    pdo_of,
    request,
)
from dvtcli.operations.api.arguments import type_of as type_named
from dvtcli.operations.api.checks import flags, path, whole, word, words
from dvtcli.operations.api.read_node import ReadNode

if TYPE_CHECKING:
    from pathlib import Path

    from dvtcli.device.node import Node as DeviceNode
    from dvtcli.domain.datatypes import Value
    from dvtcli.domain.pdo import Pdo
    from dvtcli.domain.request import PdoWant
    from dvtcli.operations.results import (
        Changed,
        NetworkApplied,
        VpdoListing,
    )

T = TypeVar("T")


class ConfiguredNode(ReadNode):
    """A node whose PDOs and objects can be changed; `Node` adds store, restore, NMT and more."""

    def write(
        self, object_: Object, value: Value, as_type: str | None = None, *, yes: bool = False, force: bool = False
    ) -> Changed:
        """Write an object by SDO download and verify it; if the read-back differs, the old value is restored.

        Bytes are written as they are, other values as *as_type* or the type in the EDS, a text such as `48V` in its
        unit. Raises UsageError for 0x1010 and 0x1011: use `store` and `restore`.
        """
        from dvtcli.operations.meanings.physical_meanings import meaning_of
        from dvtcli.operations.objects.write_object import object_type, refuse_signature, write_bytes

        def write(node: DeviceNode) -> Changed:
            index, sub_index = object_of(node, object_)
            refuse_signature(node, index)
            kind = type_named(as_type) or object_type(node, index, sub_index)
            meaning = meaning_of(node, index, sub_index)
            data = bytes_of(kind, meaning, value, f"{index:04X}:{sub_index:02X}")
            return write_bytes(self._calls.session, node, index, sub_index, data)

        return self._change(write, yes=yes, force=force)

    def map(
        self,
        pdo: str | Pdo,
        *objects: Entry,
        yes: bool = False,
        force: bool = False,
        **options: Unpack[PdoOptions],
    ) -> Changed:
        """Map *objects* into a PDO, in frame order, and enable it: as the command `map`."""
        from dvtcli.operations.changes.change import configure

        asked, wanted = request(options, enabled=True), pdo_of(pdo)

        def work(node: DeviceNode) -> Changed:
            mapped = tuple(entry_of(node, wanted_object) for wanted_object in objects)
            return configure(self._calls.session, node, {wanted: replace(asked, objects=mapped)})

        if not objects:
            raise UsageError("which objects? 'statusword', '6C01:1', …")
        return self._change(work, yes=yes, force=force)

    def set(self, pdo: str | Pdo, *, yes: bool = False, force: bool = False, **options: Unpack[PdoOptions]) -> Changed:
        """Set communication parameters of a PDO without its mapping, like the command `set`."""
        from dvtcli.operations.changes.change import configure

        if not options:
            raise UsageError("nothing to set: give transmission_type, timer_ms, cob_id, …")
        asked, wanted = request(options, enabled=None), pdo_of(pdo)
        return self._change(lambda node: configure(self._calls.session, node, {wanted: asked}), yes=yes, force=force)

    def enable(self, *pdos: str | Pdo, yes: bool = False, force: bool = False) -> Changed:
        """Enable PDOs with the mapping they have, all or none."""
        return self._switch(pdos, Switched(enabled=True), yes=yes, force=force)

    def disable(self, *pdos: str | Pdo, yes: bool = False, force: bool = False) -> Changed:
        """Disable PDOs, all or none; their mapping stays."""
        return self._switch(pdos, Switched(enabled=False), yes=yes, force=force)

    def clear(self, *pdos: str | Pdo | Literal["all"], yes: bool = False, force: bool = False) -> Changed:
        """Disable PDOs and clear their mappings, all or none; `"all"` are PDOs with a changeable mapping."""
        from dvtcli.operations.pdos.switch import clear_all

        if pdos == ("all",):
            return self._change(lambda node: clear_all(self._calls.session, node.node_id), yes=yes, force=force)
        return self._switch(pdos, Cleared(), yes=yes, force=force)

    def _switch(self, pdos: tuple[str | Pdo, ...], want: PdoWant, *, yes: bool, force: bool) -> Changed:
        from dvtcli.operations.pdos.switch import switch

        if not pdos:
            raise UsageError("which PDO? 'tpdo1', …")
        wanted = [pdo_of(pdo) for pdo in pdos]
        return self._change(lambda node: switch(self._calls.session, node.node_id, wanted, want), yes=yes, force=force)

    def undo(self, *, everything: bool = False, yes: bool = False, force: bool = False) -> Changed:
        """Undo the last change of the node, or with *everything* all of them.

        Changes are this program's; if there are none, or all are undone, those of earlier programs and commands on a
        real bus. False, with `not_put_back`, if the node does not take its old values. Raises SafetyRefusal if the node
        holds another value than the change left, UsageError if there is no change.
        """
        from dvtcli.operations.changes.undo_changes import undo_on

        flags(everything=everything)
        return self._change(
            lambda node: undo_on(self._calls.session, node.node_id, everything=everything), yes=yes, force=force
        )

    def tie(
        self, group: str, pin: int | None, object_: str | int | None, *, yes: bool = False, force: bool = False
    ) -> Changed | VpdoListing:
        """Tie *pin* (1 and up) of a group of virtual PDOs to an object, by name or index; None unties it.

        *pin* None, without an object, unties every pin of the group. If nothing changes, nothing is written, and the
        result is that of `vpdo`. Raises UsageError for an unknown object or group, DvtcliError for an unknown pin.
        """
        from dvtcli.operations.pdos.virtual_pdo_ties import tie_pin

        word("group", group, "the name of a group, such as 'digital-in'")
        number_of = 0 if pin is None else whole("pin", pin, "a pin", 254, low=1)
        if pin is None and object_ is not None:
            raise UsageError("every pin of a group can be untied, not tied: give None as the object")
        if isinstance(object_, int):
            object_ = f"{whole('object_', object_, 'an index', 0xFFFF):04X}"
        text = None if object_ is None else word("object_", object_, "an object's name or index: 'throttle', 0x2220")
        session, node_id = self._calls.session, self._node_id
        return self._change(lambda _: tie_pin(session, group, number_of, text, node_id), yes=yes, force=force)

    def apply(
        self, file: str | Path, *, include: Sequence[str] = (), yes: bool = False, force: bool = False
    ) -> NetworkApplied:
        """Write the differing configuration of *file*, a DCF, an XDC or a backup (.jsonl): all or nothing.

        *include* are manufacturer-specific objects to write as well: `2001`, `2001:1` or `2000-2FFF`. Asks, unless
        *yes*. Raises SafetyRefusal if the node is another product, or its power stage is enabled.
        """
        return self._apply_file(file, include, is_clone=False, yes=yes, force=force)

    def clone(
        self, file: str | Path, *, include: Sequence[str] = (), yes: bool = False, force: bool = False
    ) -> NetworkApplied:
        """Copy the configuration of another device of the same product from *file*, with the maker's objects.

        Leaves out objects that a PDO can map, node-IDs, commands, outputs and passcodes. The result is false if a
        differing setting was not written: the clone is incomplete.
        """
        return self._apply_file(file, include, is_clone=True, yes=yes, force=force)

    def _apply_file(
        self, file: str | Path, include: Sequence[str], *, is_clone: bool, yes: bool, force: bool
    ) -> NetworkApplied:
        from dvtcli.operations.whole_device.plan_device import DeviceOptions, apply_device

        options, chosen = DeviceOptions(words("include", include), is_clone, (self.node_id,)), str(path("file", file))
        return self._change(lambda _node: apply_device(self._calls.session, chosen, options), yes=yes, force=force)

    def _change(self, work: Callable[[DeviceNode], T], *, yes: bool, force: bool) -> T:
        calls = self._calls
        return calls.run(lambda: work(calls.session.node(self._node_id)), changes=True, yes=yes, force=force)
