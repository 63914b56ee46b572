"""What a failed way back of several nodes says: of each node its own objects, and no other's."""

from __future__ import annotations

from dvtcli.device.change.failed_change import failure_sentence, merge_left
from dvtcli.errors import LeftChanged, LeftObject


def left(node_id: int, label: str, *, known: bool = True, as_before: tuple[str, ...] = ()) -> LeftChanged:
    error = LeftChanged("not rolled back", node=node_id, state="left_changed")
    error.left = (LeftObject(node_id, label, "1800:05", b"\1", b"\0", "1 instead of 0", is_known=known),)
    error.as_before = {node_id: as_before} if as_before else {}
    return error


def test_each_node_is_said_with_what_is_left_of_it() -> None:
    error = left(5, "TPDO1", as_before=("TPDO2",))
    merge_left(error, [left(6, "0x1017:00", known=False)])
    assert error.state_text == (
        "LEFT CHANGED: TPDO1 of node 5; the present value of 0x1017:00 of node 6 is unknown; "
        "TPDO2 of node 5 is as it was, read back equal"
    )
    assert failure_sentence(error, 5, "rolled back") == "TPDO1 of node 5 could not be rolled back"
    assert failure_sentence(error, 7, "rolled back") is None


def test_where_all_was_read_as_before_the_end_of_the_roll_back_is_in_doubt_all_the_same() -> None:
    error = left(5, "TPDO1", as_before=("TPDO1", "TPDO2"))
    error.left = ()
    merge_left(error, [])
    assert error.state_text == (
        "TPDO1, TPDO2 of node 5 is as it was, read last; but the roll-back did not end: check it again"
    )
