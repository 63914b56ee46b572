"""CAN frames that Hypothesis draws."""

from __future__ import annotations

from typing import Any

from hypothesis import strategies as st

from dvtcli.domain.ports import Frame


def drawn(
    can_ids: st.SearchStrategy[int], data: st.SearchStrategy[bytes], **others: st.SearchStrategy[Any]
) -> st.SearchStrategy[Frame]:
    """Frames with *can_ids* and *data*; what *others* do not name has its default.

    `st.builds` alone draws every field of a named tuple.
    """
    defaults = {name: st.just(value) for name, value in Frame._field_defaults.items()}
    return st.builds(Frame, can_ids, data, **(defaults | others))
