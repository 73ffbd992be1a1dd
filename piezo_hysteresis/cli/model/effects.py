# Copyright 2026 piezo_hysteresis maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Print the catalogue of physical effects, or the details of one effect."""

from __future__ import annotations

import argparse
import sys

from rich.console import Console
from rich.table import Column, Table

from ...effects import BASELINE, CHAIN, UNNAMED, Effect, effect_named
from ...parameter import Parameter
from ..terminal import Output


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Declare the subcommand."""
    parser = subparsers.add_parser("effects", help="the catalogue of physical effects", description=__doc__)
    parser.add_argument("name", nargs="?", help="print all about this effect, e.g. creep")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Print the catalogue, or one effect; returns 0.

    Raises
    ------
    ModelError
        If the catalogue has no effect of that name.
    """
    console = Output(file=sys.stdout, highlight=False)
    if args.name is None:
        console.print(listing())
        console.print("For the details of one effect, type: piezo effects NAME")
    else:
        describe(effect_named(args.name), console)
    return 0


def listing() -> Table:
    """One line for every effect, in the order in which they act."""
    listed = [effect for effect in CHAIN if effect not in UNNAMED]
    names, last = Column("effect", no_wrap=True), Column("how it shows in the residual", overflow="fold")
    table = Table(names, "family", "place", last, title="Catalogue of effects, in chain order")  # names are typed
    for effect in listed:
        name = f"[dim]{effect.name}[/dim]" if effect in BASELINE else f"[bold]{effect.name}[/bold]"
        table.add_row(name, effect.family, effect.place.name.lower(), effect.signature)
    return table


def describe(effect: type[Effect], console: Console) -> None:
    """Print all details of one effect."""
    summary = (effect.__doc__ or "").strip().splitlines()[0]
    console.print(f"[bold]{effect.name}[/bold]  ({effect.family}, {effect.place.name.lower()})  {summary}")
    console.print(f"    {effect.equation}", markup=False)
    console.print(f"How it shows: {effect.signature}", markup=False)
    console.print(f"Source: {effect.source}", markup=False)
    for label, value in (("Term of", effect.host), ("Needs the channel", effect.channel)):
        if value:
            console.print(f"{label}: {value}", markup=False)
    table = Table("parameter", "symbol", "unit", "default", "bounds", "off at", "meaning")
    for row in effect.parameters:
        bounds, off = f"{row.lower:g} … {row.upper:g}", "" if row.off is None else f"{row.off:g}"
        table.add_row(row.name, row.symbol, row.unit, _default(row), bounds, off, row.meaning)
    console.print(table)


def _default(row: Parameter) -> str:
    return ", ".join(f"{v:g}" for v in row.value) if isinstance(row.value, tuple) else f"{row.value:g}"
