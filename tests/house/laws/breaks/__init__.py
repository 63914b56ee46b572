"""Ways to break each law, at least three a law, in a file a theme.

A way is a line put into a file, or a new file, that a check must notice.
"""

from __future__ import annotations

from tests.house.laws.breaks import (
    buses,
    direction,
    exits,
    laziness,
    libraries,
    printing,
    results,
    senders,
    swallowing,
    vendors,
)

BREAKS = [
    *direction.BREAKS,
    *libraries.BREAKS,
    *buses.BREAKS,
    *senders.BREAKS,
    *vendors.BREAKS,
    *laziness.BREAKS,
    *exits.BREAKS,
    *swallowing.BREAKS,
    *printing.BREAKS,
    *results.BREAKS,
]
