"""The option by which a network file's nodes are not read where their stamps say what they hold."""

from __future__ import annotations

import click

trust_stamp = click.option(
    "--trust-stamp",
    is_flag=True,
    help="Do not read nodes whose 0x1020 has the stamp of this file (stamp: true); they are named.",
)
