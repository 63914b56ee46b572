"""The words of `--fault` and `--signal`."""

from __future__ import annotations

from collections.abc import Iterator

from tests.documentation.reference.markdown import code, plain, table
from tests.documentation.reference.product import FAULT_FORMS, SIGNAL_FORMS

#: what each shape does; a period is `2s`, `500ms`, `1min` or a number of seconds
SHAPES = {
    "sine": "swings between -AMPLITUDE and AMPLITUDE, beginning with 0",
    "ramp": "moves from FROM to TO in each PERIOD, then begins at FROM again",
    "square": "is A for half of each PERIOD, then B",
    "walk": "moves by up to STEP each PERIOD, between MIN and MAX, from their middle; the same way every time",
    "const": "holds VALUE",
    "csv": "holds each value of COLUMN until the time of the next row, the last one for ever",
}


def faults() -> Iterator[str]:
    """Each fault as it is written, and what it does."""
    forms = FAULT_FORMS.values()
    return table(("fault", "what happens"), ((code(form.text), plain(form.meaning)) for form in forms))


def signals() -> Iterator[str]:
    """Each shape as it is written, and what it does."""
    forms = SIGNAL_FORMS
    assert forms.keys() == SHAPES.keys(), "say in tests/documentation/reference/faults.py what each shape does"
    return table(("shape", "the object"), ((code(forms[name]), plain(sense)) for name, sense in SHAPES.items()))
