"""Every situation in which canopen's own client was seen to go wrong, as a script of frames."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Callable
from itertools import count
from queue import SimpleQueue

import can
import pytest

from dvtcli.bus.python_can import CanBus
from dvtcli.cli.view.typed_hints import typed
from dvtcli.domain.ports import Frame
from dvtcli.errors import NoAnswer, SdoAborted, SdoProtocolError
from tests.bus.scripted import NODE, Script, Server, Steps, abort, frame, message, well_behaved
from tests.process import PATIENCE_S

Serve = Callable[..., tuple[CanBus, Server]]

DEVICE_TYPE = frame("43 00 10 00 92 01 02 00")
TIME_OUT = "00 00 04 05"


def test_expedited_read_of_each_length_is_returned_as_sent(serve: Serve) -> None:
    bus, _ = serve(Steps(*([frame(f"{command} 00 20 01 11 22 33 44")] for command in ("4F", "4B", "47", "43", "42"))))
    read = [bus.sdo(NODE).upload(0x2000, 1).hex() for _ in range(5)]
    assert read == ["11", "1122", "112233", "11223344", "11223344"]


def test_expedited_write_of_each_length(serve: Serve) -> None:
    bus, server = serve()
    for data in (b"\x01", b"\x01\x02", b"\x01\x02\x03", b"\x01\x02\x03\x04"):
        bus.sdo(NODE).download(0x1A00, 0x10, data)
    assert [request.hex(" ") for request in server.requests] == [
        "2f 00 1a 10 01 00 00 00",
        "2b 00 1a 10 01 02 00 00",
        "27 00 1a 10 01 02 03 00",
        "23 00 1a 10 01 02 03 04",
    ]


def test_segmented_read(serve: Serve) -> None:
    bus, server = serve(
        Steps(
            [frame("41 08 10 00 0A 00 00 00")],
            [frame("00")[:1] + b"simulat"],
            [frame("19")[:1] + b"ion" + bytes(4)],
        )
    )
    assert bus.sdo(NODE).upload(0x1008, 0) == b"simulation"
    assert [request[0] for request in server.requests] == [0x40, 0x60, 0x70]


def test_segmented_read_without_an_announced_size(serve: Serve) -> None:
    bus, _ = serve(Steps([frame("40 08 10 00")], [b"\x00ABCDEFG"], [frame("1F")]))
    assert bus.sdo(NODE).upload(0x1008, 0) == b"ABCDEFG"


def test_segmented_read_of_nothing(serve: Serve) -> None:
    bus, _ = serve(Steps([frame("41 08 10 00")], [frame("0F")]))
    assert bus.sdo(NODE).upload(0x1008, 0) == b""


@pytest.mark.parametrize(
    ("data", "segments"),
    [
        (b"", ["0f 00 00 00 00 00 00 00"]),
        (b"ABCDE", ["05 41 42 43 44 45 00 00"]),
        (b"ABCDEFG", ["01 41 42 43 44 45 46 47"]),
        (b"ABCDEFGH", ["00 41 42 43 44 45 46 47", "1d 48 00 00 00 00 00 00"]),
    ],
)
def test_segmented_write(serve: Serve, data: bytes, segments: list[str]) -> None:
    bus, server = serve(Steps([frame("60 08 10 00")], [frame("20")], [frame("30")]))
    bus.sdo(NODE).download(0x1008, 0, data)
    initiate = b"\x21\x08\x10\x00" + len(data).to_bytes(4, "little")
    assert [request.hex(" ") for request in server.requests] == [initiate.hex(" "), *segments]


def test_reserved_bits_of_an_answer_are_ignored(serve: Serve) -> None:
    bus, _ = serve(Steps([frame("61 08 10 00")], [frame("2F")]))
    bus.sdo(NODE).download(0x1008, 0, b"ABCDE")


def test_an_abort_carries_its_address_and_node(serve: Serve) -> None:
    bus, _ = serve(lambda request: [abort(request, 0x06040041)])
    with pytest.raises(SdoAborted) as caught:
        bus.sdo(NODE).download(0x1A00, 3, bytes(4))
    error = caught.value
    assert (error.index, error.sub_index, error.code, error.node) == (0x1A00, 3, 0x06040041, NODE)
    assert error.state == "unchanged"


def test_nothing_is_sent_after_a_segmented_write_was_refused(serve: Serve) -> None:
    bus, server = serve(lambda request: [abort(request, 0x06010002)])
    with pytest.raises(SdoAborted):
        bus.sdo(NODE).download(0x1008, 0, bytes(20))
    assert len(server.requests) == 1


def test_nothing_is_sent_after_a_segment_was_refused(serve: Serve) -> None:
    bus, server = serve(Steps([frame("60 08 10 00")], [frame("80 08 10 00 12 00 07 06")]))
    with pytest.raises(SdoAborted) as caught:
        bus.sdo(NODE).download(0x1008, 0, bytes(20))
    assert caught.value.code == 0x06070012
    assert len(server.requests) == 2


# Late answers ---------------------------------------------------------------------------------------------------


def test_late_acknowledgement_of_another_write_does_not_hide_an_abort(serve: Serve) -> None:
    late = frame("60 00 18 01")
    bus, _ = serve(Steps([], [DEVICE_TYPE], [late, frame("80 00 1A 00 41 00 04 06")]))
    with pytest.raises(NoAnswer):
        bus.sdo(NODE).download(0x1800, 1, bytes(4))
    with pytest.raises(SdoAborted):
        bus.sdo(NODE).download(0x1A00, 0, b"\1")
    assert bus.sdo(NODE).dropped.stale == 1


def test_late_acknowledgement_of_the_same_write_does_not_hide_an_abort(serve: Serve) -> None:
    bus, server = serve(Steps([], [frame("60 00 18 01"), DEVICE_TYPE], [frame("80 00 18 01 30 00 09 06")]))
    with pytest.raises(NoAnswer):
        bus.sdo(NODE).download(0x1800, 1, b"\1\0\0\0")
    with pytest.raises(SdoAborted):
        bus.sdo(NODE).download(0x1800, 1, b"\2\0\0\0")
    kinds = [request[:4].hex() for request in server.requests]
    assert kinds == ["23001801", "80001801", "40001000", "23001801"]


def test_late_value_is_not_the_next_ones(serve: Serve) -> None:
    bus, _ = serve(Steps([], [frame("4F 00 20 00 AA"), DEVICE_TYPE], [frame("4F 01 20 00 BB")]))
    with pytest.raises(NoAnswer):
        bus.sdo(NODE).upload(0x2000, 0)
    assert bus.sdo(NODE).upload(0x2001, 0) == b"\xbb"
    assert bus.sdo(NODE).dropped.stale == 1
    assert bus.sdo(NODE).dropped.other_client == 0


def test_late_segment_is_not_taken_for_one_of_the_next_object(serve: Serve) -> None:
    bus, _ = serve(
        Steps(
            [frame("41 08 10 00 07 00 00 00")],
            [],
            [b"\x01late!!!", DEVICE_TYPE],
            [frame("41 09 10 00 07 00 00 00")],
            [b"\x01in time"],
        )
    )
    with pytest.raises(NoAnswer):
        bus.sdo(NODE).upload(0x1008, 0)
    assert bus.sdo(NODE).upload(0x1009, 0) == b"in time"


def test_an_answer_that_waits_already_is_no_answer(serve: Serve) -> None:
    bus, server = serve(lambda request: [abort(request, 0x06010002)])
    bus.sdo(NODE)
    server.send(0x580 + NODE, frame("60 00 18 01"))
    with pytest.raises(SdoAborted):
        bus.sdo(NODE).download(0x1800, 1, bytes(4))


def test_a_node_that_stays_silent_is_not_sent_the_next_write(serve: Serve) -> None:
    bus, server = serve(Steps())
    with pytest.raises(NoAnswer) as first:
        bus.sdo(NODE).download(0x1800, 1, bytes(4))
    with pytest.raises(NoAnswer) as second:
        bus.sdo(NODE).download(0x1800, 2, b"\1")
    assert (first.value.state, second.value.state) == ("unknown", "unchanged")
    assert (first.value.place, second.value.place) == ("1800:01", "1800:02")
    assert [request for request in server.requests if request[0] == 0x40] == [frame("40 00 10 00")]  # the fence, once
    assert not [request for request in server.requests if request[:4] == bytes.fromhex("2F001802")]


def test_the_fence_may_be_refused_or_be_in_segments(serve: Serve) -> None:
    bus, server = serve(
        Steps(
            [],
            [frame("80 00 10 00 00 00 02 06")],
            [frame("4F 00 20 00 01")],
            [],
            [frame("41 00 10 00 04 00 00 00")],
            [frame("4F 00 20 00 02")],
        )
    )
    for expected in (b"\1", b"\2"):
        with pytest.raises(NoAnswer):
            bus.sdo(NODE).upload(0x2000, 0)
        assert bus.sdo(NODE).upload(0x2000, 0) == expected
    assert frame("80 00 10 00 00 00 00 08") in server.requests  # ends the segmented answer


# Foreign, malformed and doubled answers -------------------------------------------------------------------------


def test_an_abort_for_another_object_is_not_ours(serve: Serve) -> None:
    bus, _ = serve(Steps([frame("80 00 20 07 00 00 02 06"), frame("60 00 18 01")]))
    bus.sdo(NODE).download(0x1800, 1, bytes(4))
    assert bus.sdo(NODE).dropped.foreign == 1
    assert bus.sdo(NODE).dropped.other_client == 0, "it may be a late one, to a process before this"
    assert bus.disturbances() == []


@pytest.mark.parametrize(
    ("wrong", "counter"),
    [
        (frame("43 01 20 00 11"), "foreign"),
        (frame("43 00 20 01 11"), "foreign"),
        (frame("60 00 20 00"), "stale"),
        (frame("20"), "stale"),
        (frame("00"), "stale"),
        (frame("A0 00 20 00"), "malformed"),
        (frame("C2 00 20 00"), "malformed"),
        (frame("43 00 20 00 11")[:7], "malformed"),
        (b"\x43", "malformed"),
        (b"", "malformed"),
        (message(0x585, frame("43 00 20 00 11"), extended=True), "foreign"),
    ],
)
def test_what_is_not_the_answer_is_dropped_and_counted(serve: Serve, wrong: bytes | can.Message, counter: str) -> None:
    bus, _ = serve(Steps([wrong, frame("43 00 20 00 EF BE AD DE")]))
    assert bus.sdo(NODE).upload(0x2000, 0).hex() == "efbeadde"
    assert getattr(bus.sdo(NODE).dropped, counter) == 1
    assert bus.sdo(NODE).dropped.total == 1


def test_only_malformed_answers_are_a_protocol_error(serve: Serve) -> None:
    bus, server = serve(lambda request: [request[:3]])
    with pytest.raises(SdoProtocolError, match="malformed"):
        bus.sdo(NODE).upload(0x2000, 3)
    assert server.requests[-1] == frame(f"80 00 20 03 {TIME_OUT}")


def test_second_answers_point_at_a_second_node(serve: Serve) -> None:
    bus, _ = serve(lambda request: well_behaved(request) * 2)
    assert [bus.sdo(NODE).upload(0x2000 + i, 0)[:2] for i in range(3)] == [b"\x00\x20", b"\x01\x20", b"\x02\x20"]
    bus.sdo(NODE).download(0x2000, 0, b"\0")
    bus.sdo(NODE).upload(0x2000, 0)
    assert bus.sdo(NODE).dropped.other_client == 0
    (said,) = bus.disturbances()
    assert said.endswith(f"answers were received twice: there may be two nodes with node-ID {NODE}")
    assert bus.disturbances() == []


def test_one_doubled_answer_means_nothing(serve: Serve) -> None:
    bus, _ = serve(Steps(*[well_behaved(frame(text)) * n for text, n in (("40 00 20", 2), ("40 01 20", 1))]))
    bus.sdo(NODE).upload(0x2000, 0)
    bus.sdo(NODE).upload(0x2001, 0)
    dropped = bus.sdo(NODE).dropped
    assert (dropped.stale, dropped.doubled, dropped.other_client) == (1, 1, 0)
    assert bus.disturbances() == []


def test_the_late_answer_of_an_interrupted_transfer_means_nothing(serve: Serve) -> None:
    late = frame("43 00 20 00")
    requested: SimpleQueue[bytes] = SimpleQueue()

    def silent(request: bytes) -> list[bytes]:
        if request[1:3] != b"\0\x20":
            return well_behaved(request)
        requested.put(request)
        return []

    def interrupt() -> None:
        for _ in range(4):
            requested.get()
            time.sleep(0.05)  # it waits for its answer by now, or will do so
            signal.raise_signal(signal.SIGINT)

    bus, server = serve(silent, timeout_s=PATIENCE_S)
    interrupting = threading.Thread(target=interrupt)
    interrupting.start()
    for _ in range(4):
        with pytest.raises(KeyboardInterrupt):
            bus.sdo(NODE).upload(0x2000, 0)
        server.send(0x580 + NODE, late)
    interrupting.join()
    bus.sdo(NODE).upload(0x2001, 0)
    dropped = bus.sdo(NODE).dropped
    assert (dropped.doubled, dropped.other_client) == (0, 0)
    assert bus.disturbances() == []


def test_two_boot_ups_at_once_mean_two_nodes(serve: Serve) -> None:
    bus, server = serve()
    server.send(0x700 + NODE, b"\0")
    bus.boot_ups(NODE)
    assert bus.disturbances() == []
    time.sleep(1.1)
    for _ in range(2):
        server.send(0x700 + NODE, b"\0")
    (said,) = bus.disturbances()
    assert f"two nodes with node-ID {NODE}" in said
    assert bus.disturbances() == []


@pytest.mark.parametrize(("command", "to"), [(0x81, NODE), (0x82, 0)])
def test_another_master_s_resets_mean_no_second_node(serve: Serve, command: int, to: int) -> None:
    """A second dvtcli, for one, resets the node before it says boot-up."""
    bus, server = serve()
    assert bus.disturbances() == []
    for _ in range(3):
        server.send(0x000, bytes([command, to]))
        server.send(0x700 + NODE, b"\0")
    assert bus.boot_ups(NODE) == 3
    assert bus.disturbances() == []


def test_another_master_s_reset_explains_one_boot_up_only(serve: Serve) -> None:
    bus, server = serve()
    server.send(0x000, bytes([0x81, NODE]))
    server.send(0x700 + NODE, b"\0")
    server.send(0x700 + NODE, b"\0")
    (said,) = bus.disturbances()
    assert said.startswith("2 boot-ups after 1 reset: are there two nodes")


@pytest.mark.parametrize("data", [bytes([0x01, 0]), bytes([0x81]), bytes([0x81, NODE + 1]), bytes([0x99, 0]), b""])
def test_what_resets_no_node_explains_no_boot_up(serve: Serve, data: bytes) -> None:
    bus, server = serve()
    server.send(0x000, data)
    server.send(0x700 + NODE, b"\0")
    server.send(0x700 + NODE, b"\0")
    (said,) = bus.disturbances()
    assert said.startswith("two boot-ups within a second, and no reset was seen")


def test_doubled_segments_do_not_double_the_data(serve: Serve) -> None:
    bus, _ = serve(
        Steps([frame("41 08 10 00 0E 00 00 00")], [b"\x00ABCDEFG", b"\x00ABCDEFG"], [b"\x11HIJKLMN", b"\x11HIJKLMN"])
    )
    assert bus.sdo(NODE).upload(0x1008, 0) == b"ABCDEFGHIJKLMN"


def test_requests_of_another_client_are_counted(serve: Serve) -> None:
    bus, server = serve()
    bus.sdo(NODE).upload(0x1000, 0)
    server.send(0x600 + NODE, frame("40 00 10 01"))
    server.send(0x600 + NODE + 1, frame("40 00 10 01"))
    bus.sdo(NODE).upload(0x1000, 0)
    assert bus.sdo(NODE).dropped.other_client == 1


# Broken protocol ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("script", [Steps([frame("41 08 10 00 0E 00 00 00")], [b"\x00ABCDEFG"], [b"\x01HIJKLMN"])])
def test_wrong_toggle_bit_in_a_read(serve: Serve, script: Script) -> None:
    bus, server = serve(script)
    with pytest.raises(SdoProtocolError, match="toggle"):
        bus.sdo(NODE).upload(0x1008, 0)
    assert server.requests[-1] == frame("80 08 10 00 00 00 03 05")


def test_wrong_toggle_bit_in_a_write(serve: Serve) -> None:
    bus, server = serve(Steps([frame("60 08 10 00")], [frame("20")], [frame("20")]))
    with pytest.raises(SdoProtocolError, match="toggle") as caught:
        bus.sdo(NODE).download(0x1008, 0, bytes(14))
    assert server.requests[-1] == frame("80 08 10 00 00 00 03 05")
    assert caught.value.state == "unknown"


@pytest.mark.parametrize(
    ("announced", "segments", "code"),
    [
        (3, [b"\x01ABCDEFG"], "12 00 07 06"),
        (3, [b"\x00ABCDEFG"], "12 00 07 06"),
        (9, [b"\x01ABCDEFG"], "13 00 07 06"),
        (9, [frame("0E")], "00 00 00 08"),
    ],
)
def test_more_or_less_than_announced(serve: Serve, announced: int, segments: list[bytes], code: str) -> None:
    initiate = b"\x41\x08\x10\x00" + announced.to_bytes(4, "little")
    bus, server = serve(Steps([initiate], *([segment] for segment in segments)))
    with pytest.raises(SdoProtocolError):
        bus.sdo(NODE).upload(0x1008, 0)
    assert server.requests[-1] == frame(f"80 08 10 00 {code}")


def test_more_than_any_object_has_is_not_even_begun(serve: Serve) -> None:
    bus, server = serve(Steps([frame("41 08 10 00 FF FF FF FF")], [b"\x00ABCDEFG"], [b"\x11HIJKLMN"]))
    with pytest.raises(SdoProtocolError, match="announces 4294967295 bytes, more than any object has"):
        bus.sdo(NODE).upload(0x1008, 0)
    assert server.requests == [frame("40 08 10 00"), frame("80 08 10 00 05 00 04 05")]


# Silence --------------------------------------------------------------------------------------------------------


def test_silence_ends_with_an_abort_that_names_the_object(serve: Serve) -> None:
    bus, server = serve(Steps([DEVICE_TYPE]))
    bus.sdo(NODE).upload(0x1000, 0)
    with pytest.raises(NoAnswer) as caught:
        bus.sdo(NODE).upload(0x1A00, 3)
    assert caught.value.node == NODE
    assert caught.value.place == "1A00:03"
    assert caught.value.state == "unchanged"
    assert server.requests[1:] == [frame("40 00 1A 03"), frame(f"80 00 1A 03 {TIME_OUT}")]


def test_where_nobody_may_be_a_read_that_is_asked_for_once_is_not_aborted(serve: Serve) -> None:
    bus, server = serve(Steps())
    for _ in range(2):
        with pytest.raises(NoAnswer):
            bus.sdo(NODE).upload(0x1000, 0, retries=0)
    assert {request[0] for request in server.requests} == {0x40}


def test_a_silent_write_is_aborted_though_nobody_ever_answered(serve: Serve) -> None:
    bus, server = serve(Steps())
    with pytest.raises(NoAnswer):
        bus.sdo(NODE).download(0x1017, 0, bytes(2))
    assert server.requests[-1] == frame(f"80 17 10 00 {TIME_OUT}")


def test_a_read_whose_segment_is_lost_is_begun_anew(serve: Serve) -> None:
    announced, segment = frame("41 08 10 00 07 00 00 00"), frame("01 01 02 03 04 05 06 07")
    bus, server = serve(Steps([announced], [], [DEVICE_TYPE], [announced], [segment]), retries=1)
    assert bus.disturbance_count(NODE) == 0
    channel = bus.sdo(NODE)
    assert bus.disturbance_count(NODE) == 0
    assert channel.upload(0x1008, 0) == bytes(range(1, 8))
    assert bus.disturbance_count(NODE) == 1
    assert [request[0] for request in server.requests] == [0x40, 0x60, 0x80, 0x40, 0x40, 0x60]


def test_a_segment_alone_is_never_repeated(serve: Serve) -> None:
    bus, server = serve(Steps([frame("41 08 10 00 07 00 00 00")], []), retries=0)
    with pytest.raises(NoAnswer):
        bus.sdo(NODE).upload(0x1008, 0)
    assert [request[0] for request in server.requests] == [0x40, 0x60, 0x80]


def test_a_repeated_reads_second_answer_is_not_the_next_reads(serve: Serve) -> None:
    first, second, third = (frame(f"4F 00 20 00 0{value}") for value in (1, 2, 3))
    bus, _ = serve(Steps([], [first], [second, DEVICE_TYPE], [third]), retries=1)
    assert bus.sdo(NODE).upload(0x2000, 0) == b"\1"
    assert bus.sdo(NODE).upload(0x2000, 0) == b"\3"


def test_a_write_is_never_repeated(serve: Serve) -> None:
    bus, server = serve(Steps(), retries=3)
    with pytest.raises(NoAnswer) as caught:
        bus.sdo(NODE).download(0x1800, 1, bytes(4))
    assert caught.value.state == "unknown"
    assert [request[0] for request in server.requests] == [0x23, 0x80]


def test_a_store_may_take_longer_than_the_usual_time_out(serve: Serve) -> None:
    asked = count()

    def slow(request: bytes) -> list[bytes]:
        time.sleep(0.06)
        return [] if next(asked) else well_behaved(request)

    bus, _ = serve(slow, timeout_s=0.02, prompt=False)
    bus.sdo(NODE).download(0x1010, 1, b"save", timeout_s=PATIENCE_S)
    with pytest.raises(NoAnswer):
        bus.sdo(NODE).download(0x1010, 1, b"save")


def test_time_out_and_retries_of_one_read(serve: Serve) -> None:
    bus, server = serve(Steps(), timeout_s=5)
    with pytest.raises(NoAnswer, match=r"0\.01 s"):
        bus.sdo(NODE).upload(0x1000, 0, timeout_s=0.01, retries=2)
    # a client before this one may have been killed in the middle of a block: that is aborted
    assert [request[0] for request in server.requests] == [0x40, 0x80, 0x40, 0x40, 0x80]


# The toggle bit, segment by segment -----------------------------------------------------------------------------


def test_every_read_segment_is_asked_for_with_the_other_toggle_bit(serve: Serve) -> None:
    bus, server = serve(
        Steps(
            [frame("41 08 10 00 1C 00 00 00")],
            [b"\x00ABCDEFG"],
            [b"\x10HIJKLMN"],
            [b"\x00OPQRSTU"],
            [b"\x11VWXYZ.."],
        )
    )
    assert bus.sdo(NODE).upload(0x1008, 0) == b"ABCDEFGHIJKLMNOPQRSTUVWXYZ.."
    assert [request[0] for request in server.requests] == [0x40, 0x60, 0x70, 0x60, 0x70]


def test_every_written_segment_has_the_other_toggle_bit(serve: Serve) -> None:
    answers = [[bytes([0x20 | toggle, *bytes(7)])] for toggle in (0x00, 0x10, 0x00, 0x10)]
    bus, server = serve(Steps([frame("60 08 10 00")], *answers))
    bus.sdo(NODE).download(0x1008, 0, b"ABCDEFGHIJKLMNOPQRSTUVWXYZ")
    assert server.requests == [
        frame("21 08 10 00 1A 00 00 00"),
        b"\x00ABCDEFG",
        b"\x10HIJKLMN",
        b"\x00OPQRSTU",
        b"\x15VWXYZ\0\0",
    ]


def test_one_fence_settles_it(serve: Serve) -> None:
    bus, server = serve(Steps([], [DEVICE_TYPE], *([frame("4F 00 20 00 07")] for _ in range(3))))
    with pytest.raises(NoAnswer):
        bus.sdo(NODE).upload(0x2000, 0)
    for _ in range(3):
        assert bus.sdo(NODE).upload(0x2000, 0) == b"\7"
    asked = [request[1:4].hex() for request in server.requests if request[0] == 0x40]
    assert asked == ["002000", "001000", "002000", "002000", "002000"]


def test_after_the_fence_no_late_answer_is_expected(serve: Serve) -> None:
    answer = frame("4F 00 20 00 07")
    bus, _ = serve(Steps([], [DEVICE_TYPE], [answer, answer], [answer]))
    with pytest.raises(NoAnswer):
        bus.sdo(NODE).upload(0x2000, 0)
    for _ in range(2):
        assert bus.sdo(NODE).upload(0x2000, 0) == b"\7"
    dropped = bus.sdo(NODE).dropped
    assert (dropped.stale, dropped.doubled) == (1, 1)


def test_an_answer_too_many_is_late_once_and_a_second_node_s_from_then_on(serve: Serve) -> None:
    first, second, third = (frame(f"4F 00 20 00 0{value}") for value in (1, 2, 3))
    bus, _ = serve(Steps([], [first], [second, second, DEVICE_TYPE], [third]), retries=1)
    assert bus.sdo(NODE).upload(0x2000, 0) == b"\1"
    assert bus.sdo(NODE).upload(0x2000, 0) == b"\3"
    dropped = bus.sdo(NODE).dropped
    assert (dropped.stale, dropped.doubled) == (2, 1)


def test_a_second_answer_to_the_fence_is_no_stranger_s(serve: Serve) -> None:
    answer = frame("4F 00 20 00 07")
    bus, _ = serve(Steps([], [DEVICE_TYPE, DEVICE_TYPE], [answer]))
    with pytest.raises(NoAnswer):
        bus.sdo(NODE).upload(0x2000, 0)
    assert bus.sdo(NODE).upload(0x2000, 0) == b"\7"
    dropped = bus.sdo(NODE).dropped
    assert (dropped.stale, dropped.foreign) == (1, 0)


def test_a_read_that_is_asked_again_counts_once_and_a_silent_node_is_no_unknown_one(
    serve: Serve,
) -> None:
    bus, _ = serve(Steps(), retries=1)
    with pytest.raises(NoAnswer) as never:
        bus.sdo(NODE).upload(0x2000, 0)
    assert typed(never.value.hint).startswith("check power, node-ID and bit rate")
    assert bus.disturbance_count(NODE) == 1
    other, _ = serve(Steps([frame("4F 00 20 00 07")], []))
    assert other.sdo(NODE).upload(0x2000, 0) == b"\7"
    with pytest.raises(NoAnswer) as silent:
        other.sdo(NODE).upload(0x2000, 0)
    assert typed(silent.value.hint).startswith("it answered before")


def test_silence_says_which_answers_did_not_count(serve: Serve) -> None:
    bus, _ = serve(Steps([], [DEVICE_TYPE], [frame("43 01 20 00 11")]))
    for why in (None, "its ignored answers: 0 stale, 1 foreign, 0 malformed"):
        with pytest.raises(NoAnswer) as caught:
            bus.sdo(NODE).upload(0x2000, 0)
        assert caught.value.why == why


def test_a_segment_that_comes_before_its_request_is_none(serve: Serve) -> None:
    bus, server = serve(Steps([frame("41 08 10 00 07 00 00 00")], [b"\x01in time"]))

    def answer_early(one: Frame, sent: bool) -> None:
        if not sent and one.data[0] == 0x41:
            server.send(0x580 + NODE, b"\x01early!!")

    stop = bus.tap(answer_early)
    assert bus.sdo(NODE).upload(0x1008, 0) == b"in time"
    stop()
    assert bus.sdo(NODE).dropped.stale == 1
