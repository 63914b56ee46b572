"""What a program hands over wrongly is a UsageError that names the argument, and nothing reaches a device."""

from __future__ import annotations

import inspect
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import dvtcli
from dvtcli import errors
from dvtcli.operations.api.arguments import PdoOptions
from dvtcli.testing import Serve, serve
from tests.process import PATIENCE_S

#: a call -> the argument that its error names
WRONG: dict[str, tuple[Callable[[Any], object], str]] = {
    "no such file": (lambda node: node.verify(file="nofile.dcf"), "nofile.dcf: No such file"),
    "a folder": (lambda node: node.verify(file="."), "[.]: Is a directory"),
    "file": (lambda node: node.verify(file=1), "file=1: "),
    "frame": (lambda node: node.verify(frame="yes"), "frame='yes': "),
    "no object": (lambda node: node.map("tpdo1", None), "objects: None: "),
    "half an object": (lambda node: node.map("tpdo1", 1.5), "objects: 1.5: "),
    "a list": (lambda node: node.map("tpdo1", ["6041", "606C"]), r"objects: \['6041', '606C'\]: give objects one by"),
    "a list of tuples": (lambda node: node.map("tpdo1", [(0x6041, 0)]), r"objects: \[\(24641, 0\)\]: give objects"),
    "a tuple of objects": (lambda node: node.map("tpdo1", ("6041", "606C")), r"objects: \(.+\): give objects one by"),
    "objects by name": (lambda node: node.map("tpdo1", objects=["6041"]), "objects=…: give objects one by one"),
    "a long tuple": (lambda node: node.map("tpdo1", (1, 2, 3, 4)), r"objects: \(1, 2, 3, 4\): "),
    "a tuple of words": (lambda node: node.map("tpdo1", ("6041", 0)), r"objects: \('6041', 0\): "),
    "a short tuple": (lambda node: node.read((0x6041,)), r"object_=\(24641,\): "),
    "read nothing": (lambda node: node.read(None), "object_=None: "),
    "read true": (lambda node: node.read(True), "object_=True: "),
    "type": (lambda node: node.read(0x1000, 5), "as_type=5: "),
    "write true": (lambda node: node.write(0x1017, True), "value=True: "),
    "timer": (lambda node: node.set("tpdo1", timer_ms="10"), "timer_ms='10': "),
    "timer nan": (lambda node: node.set("tpdo1", timer_ms=float("nan")), "timer_ms=nan: "),
    "inhibit": (lambda node: node.set("tpdo1", inhibit_ms=True), "inhibit_ms=True: "),
    "rtr": (lambda node: node.set("tpdo1", rtr="no"), "rtr='no': "),
    "event": (lambda node: node.set("tpdo1", event="yes"), "event='yes': "),
    "enabled": (lambda node: node.set("tpdo1", enabled=1), "enabled=1: "),
    "extended": (lambda node: node.set("tpdo1", extended="no"), "extended='no': "),
    "sync": (lambda node: node.set("tpdo1", sync=True), "sync=True: "),
    "COB-ID": (lambda node: node.set("tpdo1", cob_id=1.5), "cob_id=1.5: "),
    "COB-ID as text": (lambda node: node.set("tpdo1", cob_id="0x201"), "cob_id='0x201': .+ an int, cob_id=0x201;"),
    "COB-ID as number": (lambda node: node.map("tpdo1", "6041", cob_id="513"), "cob_id='513': .+ an int, cob_id=513;"),
    "COB-ID as word": (lambda node: node.set("tpdo1", cob_id="Auto"), "cob_id='Auto': a CAN-ID is an int; or 'auto'"),
    "a number for a PDO": (lambda node: node.pdo(1), "pdo=1: "),
    "numbers for PDOs": (lambda node: node.disable(1), "pdo=1: "),
    "group": (lambda node: node.store([]), r"group=\[\]: "),
    "group true": (lambda node: node.store(True), "group=True: "),
    "prove": (lambda node: node.store(prove="yes"), "prove='yes': "),
    "prove restore": (lambda node: node.restore(prove="power", yes=True), "prove='power': "),
    "within": (lambda node: node.store(prove="power", within_s=-1), "within_s=-1: "),
    "if changed": (lambda node: node.store(if_changed=1), "if_changed=1: "),
    "everything": (lambda node: node.undo(everything="yes"), "everything='yes': "),
    "yes": (lambda node: node.set("tpdo1", timer_ms=10, yes="no"), "yes='no': "),
    "force": (lambda node: node.set("tpdo1", timer_ms=10, force="no"), "force='no': "),
    "NMT": (lambda node: node.nmt(1), "command=1: "),
}  # fmt: skip


@pytest.mark.parametrize(("call", "said"), WRONG.values(), ids=list(WRONG))
def test_a_wrong_argument_is_named_and_nothing_is_changed(call: Callable[[Any], object], said: str) -> None:
    with dvtcli.simulate("gen4") as bus:
        node = bus.node()
        before = [(row.pdo, row.config) for row in node.pdos()]
        with pytest.raises(errors.UsageError, match=f"^{said}") as raised:
            call(node)
        assert raised.value.state == "unchanged"
        assert [(row.pdo, row.config) for row in node.pdos()] == before


OPENING: dict[str, tuple[Callable[[], object], str]] = {
    "timeout": (lambda: dvtcli.simulate("gen4", timeout_s="1"), "timeout_s='1': "),  # type: ignore[arg-type]
    "no time": (lambda: dvtcli.simulate("gen4", timeout_s=0), "timeout_s=0: "),
    "faults": (lambda: dvtcli.simulate("gen4", faults="refuse@1=0x06040041"), "faults='refuse@1=0x06040041': "),  # type: ignore[arg-type]
    "signals": (lambda: dvtcli.simulate("gen4", signals="606C=sine(1500,2s)"), r"signals='606C="),  # type: ignore[arg-type]
    "served faults": (lambda: serve("gen4", faults="x").__enter__(), "faults='x': "),
    "nodes": (lambda: dvtcli.simulate(5), "nodes: 5: "),  # type: ignore[arg-type]
    "a call-back": (lambda: dvtcli.simulate("gen4", ask=True), "ask=True: "),  # type: ignore[arg-type]
    "bit rate": (lambda: dvtcli.connect("virtual", "api-kinds", "fast"), "bitrate='fast': "),  # type: ignore[arg-type]
    "interface": (lambda: dvtcli.connect(5), "interface=5: "),  # type: ignore[arg-type]
}  # fmt: skip


@pytest.mark.parametrize(("call", "said"), OPENING.values(), ids=list(OPENING))
def test_a_bus_is_not_opened_with_a_wrong_argument(call: Callable[[], object], said: str) -> None:
    with pytest.raises(errors.UsageError, match=f"^{said}"):
        call()


def test_a_bus_takes_numbers_and_paths(tmp_path: Path) -> None:
    with dvtcli.simulate("gen4") as bus:
        for seconds in (-1, 0, "x", None, True):
            with pytest.raises(errors.UsageError, match=r"^answer_s="):
                bus.scan(seconds)  # type: ignore[arg-type]
        with pytest.raises(errors.UsageError, match=r"^True is not a node-ID"):
            bus.node(True)
        with pytest.raises(errors.UsageError, match=r"^eds=1: "):
            bus.node(1, eds=1)  # type: ignore[arg-type]
        with pytest.raises(errors.UsageError, match=r"^profile=1: "):
            bus.node(1, profile=1)  # type: ignore[arg-type]
        with pytest.raises(errors.UsageError) as raised:
            bus.node(1, eds=tmp_path / "nosuch.eds")
    assert (
        raised.value.hint
        == "eds=FILE takes the path of an EDS, DCF, XDD or XDC, a simulated family, or a file of the EDS library"
    )


def test_what_is_none_stays_as_it_is() -> None:
    with dvtcli.simulate("gen4") as bus:
        node = bus.node()
        before = node.pdo("tpdo1").config.communication
        node.set("tpdo1", timer_ms=100, rtr=None, cob_id=None, event=None)
        after = node.pdo("tpdo1").config.communication
        assert (after.event_timer, after.cob_id) == (100, before.cob_id)


#: a wrong name -> the option that is meant
NEAR = {
    "timer": "timer_ms",
    "timr_ms": "timer_ms",
    "cobid": "cob_id",
    "inhibit_time": "inhibit_ms",
    "enable": "enabled",
}


def test_a_call_without_its_pdo_is_a_usage_error() -> None:
    with dvtcli.simulate("gen4") as bus:
        node: Any = bus.node()
        with pytest.raises(errors.UsageError, match="map: pdo is missing"):
            node.map()


@pytest.mark.parametrize(("name", "meant"), NEAR.items())
def test_a_wrong_name_of_an_option_has_the_nearest_as_hint(name: str, meant: str) -> None:
    with dvtcli.simulate("gen4") as bus:
        node: Any = bus.node()
        for call in (lambda **named: node.map("tpdo1", "6041", **named), lambda **named: node.set("tpdo1", **named)):
            with pytest.raises(
                errors.UsageError, match=f"^'{name}' is not a parameter of a PDO; these are: cob_id, "
            ) as raised:
                call(**{name: 1})
            assert raised.value.hint == f"did you mean {meant}?"
            with pytest.raises(errors.UsageError) as raised:
                call(zzz=1)
            assert raised.value.hint is None


@pytest.mark.parametrize("call", [dvtcli.Node.map, dvtcli.Node.set])
def test_a_signature_lists_the_options_of_a_pdo_and_the_docstring_tells_of_each(call: Callable[..., object]) -> None:
    parameters = inspect.signature(call).parameters
    options = {name: one for name, one in parameters.items() if name in PdoOptions.__annotations__}
    kinds = {name: kind.__forward_arg__ for name, kind in PdoOptions.__annotations__.items()}
    assert {name: one.annotation for name, one in options.items()} == kinds
    assert {one.kind for one in options.values()} == {inspect.Parameter.KEYWORD_ONLY}
    assert {name: one.default for name, one in options.items() if one.default is not None} == (
        {"enabled": True} if call is dvtcli.Node.map else {}
    )
    assert not any(one.kind is one.VAR_KEYWORD for one in parameters.values())
    described = inspect.getdoc(call) or ""
    assert [name for name in options if f"*{name}*" not in described] == []


def test_what_a_map_is_not_asked_for_stays_and_enabled_none_keeps_a_pdo_disabled() -> None:
    with dvtcli.simulate("gen4") as bus:
        node = bus.node()
        node.disable("tpdo1")
        before = node.pdo("tpdo1").config.communication
        node.map("tpdo1", "6041", enabled=None)
        assert node.pdo("tpdo1").config.communication == before
        node.map("tpdo1", "6041", cob_id="keep")
        assert node.pdo("tpdo1").config.enabled


def test_nothing_but_none_is_nothing_to_set() -> None:
    with dvtcli.simulate("gen4") as bus, pytest.raises(errors.UsageError, match=r"^nothing to set: "):
        bus.node().set("tpdo1", timer_ms=None, cob_id=None)


def test_a_node_that_was_started_is_not_listed_without_heartbeat() -> None:
    with dvtcli.simulate("gen4@5", "generic@7") as bus:
        for node_id in (7, 5):  # 7 is waited for until it is heard, 5 says its state at once
            bus.node(node_id).nmt("start", yes=True)
        states = {row.node: row.state for row in bus.scan()}
        assert states[5] == bus.node(5).identity().state == "OPERATIONAL"
        assert states[7] == bus.node(7).identity().state


def test_no_heartbeat_is_said_only_of_a_node_that_sends_none() -> None:
    with dvtcli.simulate("tmcm@7") as bus:
        node = bus.node()
        nmt = node.canopen().nmt
        node.write(0x1017, 60_000, "u16")
        while nmt.timestamp is None:  # the first heartbeat comes at once, whenever that is
            node.read(0x1017)
        nmt.state = "PRE-OPERATIONAL"
        assert [row.state for row in bus.scan()] == ["state unknown"]
        node.write(0x1017, 0, "u16")
        nmt.state = "PRE-OPERATIONAL"
        assert [row.state for row in bus.scan()] == ["no heartbeat"]


def test_what_a_dry_run_did_not_prove_is_not_true() -> None:
    with dvtcli.simulate("gen4") as bus:
        node = bus.node()
        with bus.dry_run():
            for proved in (node.store(prove=True, yes=True), node.restore(prove=True, yes=True)):
                assert not proved
                assert (proved.proof, proved.document()["proved"], proved.exit_code) == (None, None, 0)
            assert node.store()
            assert node.restore(yes=True)
        assert node.store(prove=True, yes=True)


#: a call -> its error's text, and what a traceback says besides
TOLD: dict[str, tuple[Callable[[], object], str, list[str]]] = {
    "no bus": (
        lambda: dvtcli.connect("pcan", "PCAN_USBBUS1"), "cannot open pcan:PCAN_USBBUS1", ["why: ", "hint: ", "state: "]
    ),
    "no family": (lambda: dvtcli.simulate("nix"), "nix: no such family and no such file", ["hint: "]),
    "nothing set": (
        lambda: dvtcli.simulate("gen4").node().verify(),
        "nothing to compare: this session did not set anything", [],
    ),
    "a rule": (
        lambda: dvtcli.simulate("gen4").node().map("tpdo1", "606C", "606C", "6041"),
        "TPDO1 ", ["rule: pdo-length at ", "state: unchanged"],
    ),
    "the wrong way": (
        lambda: dvtcli.simulate("gen4").node().map("rpdo1", "6041"),
        "", ["`node.objects(mappable='rpdo')`", "state: unchanged"],
    ),
    "refused": (
        lambda: dvtcli.simulate("gen4", faults=["refuse@3=0x06040041"]).node().map("tpdo1", "606C", "6041"),
        "node 1 refused step 3 of 6 of TPDO1", ["state: rolled_back"],
    ),
    "silent": (
        lambda: dvtcli.simulate("gen4").node(5).pdos(), "node 5", ["`bus.scan()` lists the nodes", "state: unchanged"]
    ),
}  # fmt: skip


@pytest.mark.parametrize(("call", "text", "notes"), TOLD.values(), ids=list(TOLD))
def test_a_traceback_says_what_and_why_and_what_next(call: Callable[[], object], text: str, notes: list[str]) -> None:
    with pytest.raises(errors.DvtcliError) as raised:
        call()
    shown = "".join(traceback.format_exception_only(raised.value)).splitlines()
    assert shown[0].partition(": ")[2].startswith(text)
    for note in notes:
        assert any(note in line for line in shown[1:]), shown
    assert "--" not in "".join(shown)


def test_another_bus_of_this_program_is_no_other_process(dvtcli_serve: Serve) -> None:
    served = dvtcli_serve("gen4@5")
    said: list[errors.DvtcliError] = []
    with served.connect(timeout_s=PATIENCE_S) as other:

        def write_too(_: object) -> None:
            if not said:
                with pytest.raises(errors.SafetyRefusal) as raised:
                    other.node(5).set("tpdo1", timer_ms=20)
                said.append(raised.value)

        with served.connect(timeout_s=PATIENCE_S, on_progress=write_too) as bus:
            bus.node(5).set("tpdo1", timer_ms=10)
    assert said[0].text.startswith("another Bus of this program is changing node 5")
    assert said[0].hint == "try again when its call has ended"
