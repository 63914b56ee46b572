"""What is compared was read in one life of the node, and with no answer lost on the way."""

from __future__ import annotations

from dataclasses import dataclass

import pytest

from dvtcli.device.node import Node
from dvtcli.device.target_config import TargetConfig, config_differences
from dvtcli.domain.pdo import Pdo
from dvtcli.errors import NoAnswer
from tests.laws.bench import NODE, DirectBus, DirectSdo, booted, dictionary, profile

TPDO1 = Pdo.parse("tpdo1")
OBJECT = (0x6081, 0)


@dataclass
class Upset(DirectSdo):
    """While *left* is above 0, an upload of the last object that is compared has to be asked again."""

    left: int = 0
    disturbance_count: int = 0

    def upload(
        self, index: int, sub_index: int, *, timeout_s: float | None = None, retries: int | None = None
    ) -> bytes:
        if (index, sub_index) == OBJECT and self.left:
            self.left -= 1
            self.disturbance_count += 1
        return super().upload(index, sub_index, timeout_s=timeout_s, retries=retries)


@dataclass
class UpsetBus(DirectBus):
    """A bus that counts the uploads that were asked again."""

    def disturbance_count(self, node_id: int) -> int:
        assert isinstance(self.channel, Upset)
        return self.boot_ups(node_id) + self.channel.disturbance_count


def node() -> tuple[Node, Upset]:
    channel = Upset(booted())
    return Node(UpsetBus(channel.device, channel), NODE, dictionary("generic"), profile("generic")), channel


def test_a_comparison_during_which_an_answer_was_lost_starts_over() -> None:
    one, channel = node()
    held = one.pdo(TPDO1)
    target = TargetConfig({TPDO1: held}, {OBJECT: one.upload(*OBJECT)})
    channel.left = 1
    channel.reads.clear()
    assert config_differences(one, target) == ()
    assert channel.reads.count((TPDO1.communication_index, 1)) == 2
    assert channel.reads.count(OBJECT) == 2


def test_a_node_that_never_keeps_still_is_said_to_have_been_read_back_in_vain() -> None:
    one, channel = node()
    target = TargetConfig(values={OBJECT: one.upload(*OBJECT)})
    channel.left = 100
    with pytest.raises(NoAnswer, match="node 1 restarted, or lost an answer, during each of 5 readings") as caught:
        config_differences(one, target)
    assert caught.value.node == NODE


def test_a_difference_is_told_of_what_was_read_last() -> None:
    one, _ = node()
    held = one.pdo(TPDO1)
    wanted = held.with_parameters(event_timer=77)
    assert [label for label, _ in config_differences(one, TargetConfig({TPDO1: wanted}))] == ["TPDO1"]
