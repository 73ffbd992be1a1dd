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

"""The page about a plan: whether the path is reachable, the expected error, and the drive."""

from __future__ import annotations

from ..compensation.plan import Plan
from ..model.model import Model
from .document import chain, framed
from .figures.tracking import tracking
from .page import Page
from .tables.plan_table import notes, plan_table
from .verdict import VerdictText
from .words import nanometre

FOOTER = (
    "This is a computation; nothing has moved. The planned error is the difference between the wanted and the "
    "simulated displacement. The expected error is the root of the sum of squares of the planned error and of the "
    "error of the model: its free-run error, or the uncertainty of its parameters on this path if that is larger. "
    "Percentages are RMS errors over the range of the path."
)
"""Explanation of the numbers."""
MERIT = ("drive voltage", "largest slew")
"""Rows of the plan that are repeated under the headline."""


def plan_page(plan: Plan, model: Model, source: str) -> Page:
    """Write the page.

    Parameters
    ----------
    plan : Plan
        Plan for the path.
    model : Model
        Model whose inverse was used.
    source : str
        File of the path.
    """
    drawing, table = tracking(plan), plan_table(plan)
    total = plan.expected.total
    merit = [(name, value) for name, value in table.rows if name in MERIT]
    merit.append(("expected error, rms", nanometre(total)))
    if plan.range:
        merit.append(("of the path's range", f"{100.0 * total / plan.range:.3g} %"))
    if plan.reachability.is_whole:
        headline = f"The stage can follow the whole path; the expected error is {nanometre(total)} rms"
    else:
        headline = "The limits of the drive do not allow the whole path"
    verdict = VerdictText(headline, tuple(f"{line[:1].upper()}{line[1:]}." for line in notes(plan)))
    html = framed(
        "Compensation: a plan", source, chain(model), verdict, tuple(merit), {"Plan": ([drawing], [table])}, FOOTER
    )
    return Page(html, (drawing,))
