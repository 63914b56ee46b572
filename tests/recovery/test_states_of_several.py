"""The error of a command about several nodes: the state of each, and the worst of them."""

from __future__ import annotations

from dvtcli.errors import DvtcliError, NoAnswer, State, worst_of


def failed(node_id: int, state: State) -> DvtcliError:
    return NoAnswer(f"node {node_id} does not answer", node=node_id, state=state)


def test_two_failures_are_told_apart_also_if_no_node_went_back() -> None:
    failures = [failed(5, "unchanged"), failed(6, "left_changed")]
    error = worst_of(failures)
    error.beside([], failures, "rolled back")
    assert error.node == 6
    assert error.nodes == {5: "unchanged", 6: "left_changed"}
    assert error.worst_state == "left_changed"


def test_of_two_failures_of_a_node_the_worse_state_counts() -> None:
    for failures in (
        [failed(5, "left_changed"), failed(5, "unchanged")],
        [failed(5, "unchanged"), failed(5, "left_changed")],
    ):
        error = worst_of(failures)
        error.beside([6], failures, "rolled back")
        assert error.nodes == {6: "rolled_back", 5: "left_changed"}


def test_one_failure_alone_has_no_list() -> None:
    error = failed(5, "unknown")
    error.beside([], [error], "rolled back")
    assert error.nodes == {}
    assert error.worst_state == "unknown"
