"""Print an object's value as in plans, for comparisons."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.device.virtual_pdos import names_objects
from dvtcli.domain.plan import Step
from dvtcli.domain.shown_value import step_text
from dvtcli.operations.meanings.object_values import understood

if TYPE_CHECKING:
    from dvtcli.device.node_parts import NodeDescription


def planned_words(node: NodeDescription, index: int, sub_index: int, data: bytes) -> str:
    """Print *data* with its scaling, if known; else raw."""
    step = Step(index, sub_index, None, data, "", names_objects(node, index, sub_index))
    return step_text(step, data, understood(node, {step.object: len(data)}).get(step.object))
