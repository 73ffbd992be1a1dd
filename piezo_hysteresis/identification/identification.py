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

"""`Identification`: the identified model with its uncertainties, errors and notices."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..effects import Arx
from ..html_table import html_table
from ..model.model import Model
from ..model.parameter_covariance import response_error
from ..parameter import number_text
from ..picture import Picture, picture_of
from ..record import Experiment, Notice, Samples
from .fit.fit import Fit
from .fit.normal_equations import Nuisance, residuals
from .records.excitation_content import moving
from .records.roles import Roles
from .steps.comparison import InputComparison
from .steps.delay import Delay
from .steps.dynamics import Dynamics
from .steps.order_choice import OrderError
from .steps.three_steps import ThreeSteps
from .structure.mode import assumed_numbers
from .structure.structure_choice import StructureChoice

CORRELATED = 0.95
"""Correlation from which two parameters are reported as hard to separate."""
INSEPARABLE = 1.0 - 1e-4
"""Correlation from which only a combination of two parameters is determined."""


def undetermined(fit: Fit) -> tuple[str, ...]:
    """Parameters at a bound after a fit, except those that are off there, such as a play without weight."""
    return tuple(n for n in fit.at_bounds if fit.model.row(n).off != fit.values[n])


def correlated_pairs(fit: Fit, least: float) -> tuple[tuple[str, str, float], ...]:
    """Pairs of parameters, those of G aside, whose correlation is at least `least`: names and correlation."""
    names = [n for n in fit.names if not n.startswith(f"{Arx.name}.")]
    pairs = [(a, b, fit.correlation(a, b)) for i, a in enumerate(names) for b in names[:i]]
    return tuple(pair for pair in pairs if abs(pair[2]) > least)


def scale_note(model: Model) -> str:
    """A sentence about the scales of the parameters without a unit."""
    drive, stroke = model.voltage_scale, 1e6 * model.displacement_scale
    return f"Parameters with the unit 1 belong to the scales v = u / {drive:.5g} V and x = y / {stroke:.5g} µm."


@dataclass(frozen=True, slots=True)
class PhaseError:
    """Free-run error of one record, without its mean.

    Parameters
    ----------
    phase : str
        Phase name.
    rms : float
        RMS of measured minus simulated displacement [m].
    percent : float
        `rms` in per cent of the range of the experiment.
    is_fitted : bool
        False for held-out data.
    is_moving : bool
        Whether the drive moves noticeably.
    """

    phase: str
    rms: float
    percent: float
    is_fitted: bool
    is_moving: bool


def phase_errors(model: Model, experiment: Experiment, roles: Roles) -> tuple[PhaseError, ...]:
    """Free-run errors of the fitted records, followed by those of the held-out records.

    Parameters
    ----------
    model : Model
    experiment : Experiment
    roles : Roles
        Purpose of every record.
    """
    errors = residuals(model, experiment.records, Nuisance(offset=True))
    rms = [float(np.sqrt(np.mean(e**2))) for e in errors]
    moved = moving(roles.contents)
    return tuple(
        PhaseError(
            phase=experiment[i].phase,
            rms=rms[i],
            percent=100.0 * rms[i] / experiment.range,
            is_fitted=i in roles.fitted,
            is_moving=roles.contents[i] in moved,
        )
        for i in (*roles.fitted, *roles.held_out)
    )


@dataclass(frozen=True, eq=False, slots=True)
class Identification:
    """Result of `identify`.

    Parameters
    ----------
    model : Model
        Identified model, including the sensor offset.
    fit : Fit
        Joint fit, with its covariance and the bounds that it reached.
    delay : Delay or None
        Result of step 1; None if no step was recorded.
    dynamics : Dynamics or None
        ARX model from w, the start of the joint fit; None if the data only show a lag.
    published : ThreeSteps or None
        Result of the three published steps alone; None if their phases are missing.
    orders : tuple of OrderError
        Error of every model order that was compared.
    comparisons : tuple of InputComparison
        G from v and from w at each noise amplitude.
    phases : tuple of PhaseError
        Free-run error of every record.
    notices : tuple of Notice
        Warnings as data.
    structure : StructureChoice or None
        Choice of the structure; None if none was made.
    """

    model: Model
    fit: Fit
    delay: Delay | None
    dynamics: Dynamics | None
    published: ThreeSteps | None
    orders: tuple[OrderError, ...]
    comparisons: tuple[InputComparison, ...]
    phases: tuple[PhaseError, ...]
    notices: tuple[Notice, ...]
    structure: StructureChoice | None = None

    def plot(self, experiment: Experiment) -> Picture:
        """The free run of the model against the measurement, with the residual and the 95 % band."""
        return picture_of(self, experiment)

    @property
    def judged(self) -> tuple[PhaseError, ...]:
        """Errors of the held-out records, or of the fitted ones if there are none; without rests.

        The error of a rest is the noise, so the rests between the drives would hide the error of what moves.
        """
        tested = tuple(p for p in self.phases if not p.is_fitted) or self.phases
        return tuple(p for p in tested if p.is_moving) or tested

    @property
    def free_run_error(self) -> float:
        """RMS free-run error over the tested records in which the drive moves, with equal weights [m]."""
        return float(np.sqrt(np.mean([p.rms**2 for p in self.judged])))

    @property
    def free_run_percent(self) -> float:
        """`free_run_error` in per cent of the range."""
        return float(np.sqrt(np.mean([p.percent**2 for p in self.judged])))

    @property
    def correlated(self) -> tuple[tuple[str, str, float], ...]:
        """Pairs of hysteresis parameters with strongly correlated estimates: names and correlation."""
        return correlated_pairs(self.fit, CORRELATED)

    def response(self, frequency: Samples) -> tuple[np.ndarray, Samples]:
        """G at `frequency` [Hz] and its relative standard error (`response_error`), both of shape (k,)."""
        arx = self.model.effect(Arx)
        rows = [k for k, name in enumerate(self.fit.names) if name.startswith(f"{Arx.name}.")]
        names, covariance = [self.fit.names[k] for k in rows], self.fit.covariance[np.ix_(rows, rows)]
        error = response_error(self.model, names, covariance, np.asarray(frequency))
        return arx.response(frequency, self.model.sample_period), error

    def __repr__(self) -> str:
        return f"Identification({self.model!r}, free-run error {self.free_run_percent:.3g} % of range)"

    def _repr_html_(self) -> str:
        rows = (
            (p.phase, f"{p.percent:.3f}", f"{1e9 * p.rms:.1f}", "fitted" if p.is_fitted else "not fitted")
            for p in self.phases
        )
        return html_table(repr(self), ("phase", "% of range", "nm", "data"), rows)

    def __str__(self) -> str:
        arx = self.model.effect(Arx)
        lines = []
        if self.delay is not None:
            lines.append(str(self.delay))
        orders = f"na = {arx.array('a').size}, nb = {arx.array('b').size}, d = {arx['delay']:g}"
        lag = arx.group_delay * self.model.sample_period
        lines.append(f"G: {orders}, dc gain {arx.dc_gain:.5g} (fixed), lag {lag * 1e6:.4g} µs")
        lines.append(scale_note(self.model))
        assumed = assumed_numbers(self.model)
        for name, value in self.fit.values.items():
            if not name.startswith(f"{Arx.name}.") or name == f"{Arx.name}.delay":
                half = None if name in assumed else 1.96 * self.fit.standard_errors[name]
                sure = "" if half is None else f" ± {half:.2g} (95 %)"
                lines.append(f"{name:28s} {number_text(value, half):>12s}{sure}")
        for phase in self.phases:
            message = "" if phase.is_fitted else "  not fitted"
            lines.append(f"{phase.phase:28s} {phase.percent:9.4f} % of range {phase.rms * 1e9:10.4g} nm{message}")
        lines += [str(c) for c in self.comparisons]
        lines += [f"{a} and {b} correlate by {c:.3f}" for a, b, c in self.correlated]
        lines += [f"{n.kind}: {n.message}" for n in self.notices]
        return "\n".join(lines)
