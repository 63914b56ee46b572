"""`lss scan` and `lss identify`: nodes without a node-ID are found, each once."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dvtcli.domain.nmt import UNCONFIGURED, NmtState
from dvtcli.simulator.device.strict_device import StrictDevice
from tests.cli.commands.lss.lss_bench import bench
from tests.lss_nodes import address_of, unconfigured

pytestmark = pytest.mark.drawn(14, "lss")


def test_a_node_is_found_named_and_stored() -> None:
    device = unconfigured(0xC0FFEE)
    with bench(device) as session:
        found = session.run("lss scan --json").document
        (row,) = found["nodes"]
        assert (row["serial"], row["node"], row["confirmed"]) == (0xC0FFEE, None, True)
        assert (found["requests"], found["without_node_id"]) == (1 + 133 + 3 + 5 + 1, 1)
        told = session.run(f"lss node-id 5 {address_of(device)} --json").document
        assert (told["nodes"][0]["before"], told["nodes"][0]["node"]) == (None, 5)
        assert (device.node_id, device.lss.stored, device.state) == (5, UNCONFIGURED, NmtState.PRE_OPERATIONAL)
        assert session.run("lss store 5 --json").document["nodes"][0]["stored"]
        assert device.lss.stored == 5
        assert session.run("lss scan --json").document["nodes"] == []


def answers_in_any_state(device: StrictDevice) -> None:
    """As durand's LSS slave does, which is found by a fast scan again though it is being configured."""
    handle = device.lss.handle

    def answer(request: bytes) -> bytes | None:
        if request[0] == 0x51:
            device.lss._configuring = False
        return handle(request)

    device.lss.handle = answer  # type: ignore[method-assign]


def test_slaves_that_are_found_again_and_again_are_told_apart_by_every_branch() -> None:
    nodes = [unconfigured(1), unconfigured(2)]
    for device in nodes:
        answers_in_any_state(device)
    with bench(*nodes) as session:
        ran = session.run("lss scan --json")
        assert (ran.code, [row["serial"] for row in ran.document["nodes"]]) == (0, [1, 2]), ran.stderr


@settings(deadline=None, max_examples=max(3, settings().max_examples // 6))
@given(
    st.lists(
        st.tuples(st.integers(2, 0xFFFF_FFFF), st.sampled_from(["generic", "lss-echo"])),
        max_size=4,
        unique_by=lambda device: device[0],
    )
)
def test_who_answers_every_question_while_it_is_configured_counts_once(serials: list[tuple[int, str]]) -> None:
    nodes = [unconfigured(serial, family) for serial, family in serials]
    with bench(*nodes, unconfigured(1, node_id=3)) as session:
        ran = session.run("lss scan --json")
        assert ran.code == 0, ran.stderr
        found = [row["serial"] for row in ran.document["nodes"]]
        assert sorted(found) == sorted(serial for serial, _ in serials)
        assert all(row["confirmed"] for row in ran.document["nodes"])
        assert ran.document["without_node_id"] == len(serials)
        assert all(device.lss.pending == UNCONFIGURED for device in nodes)


def test_the_scan_names_a_node_id_that_is_free() -> None:
    device = unconfigured(7)
    others = [unconfigured(number, node_id=number) for number in (1, 2, 4)]
    with bench(device, *others) as session:
        scanned = session.run("lss scan")
        assert session.run("lss scan --json").document["free_node_id"] == 3
        line = next(line.strip() for line in scanned.stdout.splitlines() if line.strip().startswith("lss node-id"))
        assert line.startswith("lss node-id 3 ")
        assert session.run(line).code == 0
        assert device.node_id == 3
        assert session.run("lss scan --json").document["free_node_id"] is None


def test_where_every_node_id_is_taken_none_is_proposed() -> None:
    with bench(unconfigured(200), *(unconfigured(number, node_id=number) for number in range(1, 128))) as session:
        ran = session.run("lss scan")
        assert (ran.code, "node-id" in ran.stdout, "no node-ID is free" in ran.stdout) == (0, False, True), ran.stdout


def test_nobody_says_so_soon() -> None:
    with bench(unconfigured(1, node_id=3)) as session:
        ran = session.run("lss scan")
        assert (ran.code, "no node without a node-ID answers" in ran.stdout) == (0, True)
        assert session.session.bus.now_s() < 2


def test_two_nodes_with_one_identity_are_refused() -> None:
    nodes = [unconfigured(1), unconfigured(1)]
    with bench(*nodes) as session:
        ran = session.run("lss scan --json")
        assert (ran.code, [row["confirmed"] for row in ran.document["nodes"]]) == (1, [False])
        ran = session.run(f"lss node-id 5 {address_of(nodes[0])}")
        ran.failed(1, "more than one node answers")
        assert {device.lss.pending for device in nodes} == {UNCONFIGURED}


@given(st.lists(st.integers(0, 0xFFFFFFFF), min_size=2, max_size=2), st.sampled_from([1, 0x800, 0xFFFFFFFF]))
@settings(max_examples=max(4, settings().max_examples // 5))
def test_who_is_within_ranges_says_so(ends: list[int], serial: int) -> None:
    low, high = sorted(ends)
    device = unconfigured(serial, node_id=5)
    vendor, product, revision, _serial = address_of(device).parts
    with bench(device) as session:
        words = f"lss identify vendor={vendor} product={product} revision={revision} serial={low}-{high} --json"
        assert session.run(words).document["within"] == (low <= serial <= high)
        assert session.run(f"lss identify vendor={vendor} product={product} --json").document["within"]
        assert not session.run(f"lss identify vendor={vendor} product={product + 1} --json").document["within"]
        assert device.state is NmtState.PRE_OPERATIONAL
