"""A value of one object as a plan shows it, for what compares by the same values."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.device.virtual_pdos import names_objects
from dvtcli.domain.plan import Step
from dvtcli.domain.shown_value import step_text
from dvtcli.operations.meanings.object_values import understood

if TYPE_CHECKING:
    from dvtcli.device.node import Node


def planned_words(node: Node, index: int, sub_index: int, data: bytes) -> str:
    """*data* with what it means, where somebody says that; else as the field writes it."""
    step = Step(index, sub_index, None, data, "", names_objects(node, index, sub_index))
    return step_text(step, data, understood(node, {step.object: len(data)}).get(step.object))
