"""What is said of missing heartbeats, and how often."""

from __future__ import annotations

from dvtcli.cli.prompt.bus_watch import MOST, WITHIN_S, Silences


def test_a_missing_heartbeat_is_said_once_and_once_that_it_is_back() -> None:
    silences = Silences()
    assert silences.heard_of({5: (0.2, False)}, 0.0) == []
    assert silences.heard_of({5: (3.5, True)}, 3.5) == ["node 5  heartbeat lost: the last was received 3.5 s ago"]
    assert silences.heard_of({5: (4.5, True)}, 4.5) == []
    assert silences.heard_of({5: (0.1, False)}, 5.0) == ["node 5  heartbeat is back"]


def test_many_nodes_are_one_message() -> None:
    silences = Silences()
    gone = {node_id: (2.0 + node_id / 100, True) for node_id in (1, 2, 3)}
    assert silences.heard_of(gone, 1.0) == [
        "nodes 1, 2 and 3  heartbeats lost: the last were received 2.0 to 2.0 s ago"
    ]
    assert silences.heard_of(dict.fromkeys(gone, (0.0, False)), 2.0) == ["nodes 1, 2 and 3  heartbeats are back"]


def test_heartbeats_that_come_and_go_are_not_said_each_time_and_the_last_state_is() -> None:
    silences = Silences()
    told = [silences.heard_of({5: (1.0, bool(step % 2))}, step / 10) for step in range(60)]
    assert sum(map(len, told)) == MOST
    assert silences.heard_of({5: (9.0, True)}, 60 / 10) == []
    assert silences.heard_of({5: (9.0, True)}, WITHIN_S + 1) == [
        "node 5  heartbeat lost: the last was received 9.0 s ago"
    ]


def test_a_node_that_started_anew_is_not_missed() -> None:
    silences = Silences()
    silences.heard_of({5: (9.0, True)}, 0.0)
    silences.started(5)
    assert silences.heard_of({5: (0.0, False)}, 1.0) == []
