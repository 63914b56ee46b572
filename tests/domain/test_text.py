"""Lists of nodes in sentences."""

from __future__ import annotations

import pytest

from dvtcli.domain.text import all_nodes, some_nodes


@pytest.mark.parametrize(
    ("node_ids", "every", "some"),
    [
        ([1], "node 1", "node 1"),
        ([1, 5], "nodes 1 and 5", "nodes 1 and 5"),
        ([1, 5, 9], "nodes 1, 5 and 9", "nodes 1, 5 and 9"),
        ([1, 2, 3, 4, 5], "nodes 1, 2, 3, 4 and 5", "nodes 1, 2, 3 and 2 more"),
    ],
)
def test_nodes_are_named_as_in_a_sentence(node_ids: list[int], every: str, some: str) -> None:
    assert (all_nodes(node_ids), some_nodes(node_ids)) == (every, some)
    assert all_nodes(map(str, node_ids)) == every
