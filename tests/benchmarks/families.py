"""The same configurations on every simulated family, as one table: `python tests/benchmarks/families.py`.

A cell says `taken`, the rule that refused the configuration before anything was written, or `ABORTED` where the
device had to. Exits with 1 where there is such an abort.
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

from tests.families.matrix import ABORTED, cells, table


def main() -> int:
    """Print the table."""
    found = list(cells())
    print("\n".join(table(found)))
    return int(any(cell.outcome == ABORTED for cell in found))


if __name__ == "__main__":
    sys.exit(main())
