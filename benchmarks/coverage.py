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

"""Coverage of the 95 % intervals that `piezo diagnose` gives for the parameters of a named effect.

The stage is `independent_plant`, with another integration and other forms than the catalogue. Parameters with the same
meaning in plant and model are compared, some after a change of unit (`truth_of`). The weights of plays, the corner of a
limit, springs and polynomials are left out, because their forms differ.

    python -m benchmarks.coverage --seeds 1 2
"""

from __future__ import annotations

import argparse

import numpy as np

from benchmarks.independent_plant import Plant
from benchmarks.naming_cases import Case
from piezo_hysteresis.discrepancy import diagnose
from piezo_hysteresis.model.model import Model

COMPARED = (
    "creep",
    "hysteresis_exponent",
    "thermal_drift",
    "gain_drift",
    "asymmetric_hysteresis",
    "rate_dependent_hysteresis",
    "initial_state",
    "backlash",
    "amplifier_bandwidth",
    "amplifier_slew_limit",
    "extra_resonance",
    "axis_coupling",
)
"""Effects with parameters that mean the same in plant and model."""


def truth_of(plant: Plant, model: Model) -> dict[str, float]:
    """True values of the parameters of the hidden effects, in the units of the model, by parameter.

    Parameters
    ----------
    plant : Plant
        Voltages relative to `plant.volt`, lengths to its stroke.
    model : Model
        Gives the scales of voltage and displacement.
    """
    shrink = plant.volt / model.voltage_scale
    gain = model["arx"].dc_gain  # type: ignore[attr-defined]
    unit = plant.stroke / ((plant.p1 + plant.p2) * model.displacement_scale * gain)
    found: dict[str, float] = {}
    for name, value in plant.hidden.items():
        match name, value:
            case "creep", ("logarithmic", gamma):
                found |= {"creep.gamma": gamma, "creep_fractional.gamma": gamma, "creep_fractional.exponent": 0.0}
            case "creep", ("fractional", gamma):  # weights by (τ/1 s)^0.15, in the model by (τ/0.1 s)^0.15
                found |= {"creep_fractional.gamma": gamma * 0.1**0.15, "creep_fractional.exponent": 0.15}
            case "thermal_drift", (size, tau):
                found |= {"thermal_drift.D": size * plant.stroke, "thermal_drift.tau": tau}
            case "gain_drift", (size, tau):
                found |= {"gain_drift.g": size, "gain_drift.tau": tau}
            case "asymmetric_hysteresis", (first, second):
                found |= {"asymmetric_hysteresis.phi1": first / shrink, "asymmetric_hysteresis.phi2": second / shrink}
            case "rate_dependent_hysteresis", (k, a):
                speed = shrink**-a
                k = k * speed / (1.0 + k / a * (speed - 1.0))
                for form in ("rate_dependent_hysteresis", "rate_dependent_hysteresis_lagged"):
                    found |= {f"{form}.k": k, f"{form}.a": a}
            case "extra_resonance", (frequency, zeta, _):
                found |= {"extra_resonance.f0": frequency, "extra_resonance.zeta": zeta}
            case "hysteresis_exponent", n:
                found["hysteresis_exponent.n"] = n
            case "initial_state", h0:
                found["initial_state.h0"] = h0 * unit
            case "backlash", width:
                found["backlash.b"] = width * plant.volt
            case "amplifier_bandwidth", tau:
                found |= {"amplifier_bandwidth.tau": tau, "amplifier_bandwidth_held.tau": tau}
            case "amplifier_slew_limit", slew:
                forms = ("amplifier_slew_limit", "amplifier_slew_limit_settling")
                found |= {f"{form}.S": slew * plant.volt for form in forms}
            case "axis_coupling", kappa:
                found["axis_coupling.kappa0"] = kappa
    return found


def main() -> None:
    """Diagnose every effect in stages of several seeds, and count the intervals that contain the true value."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--effects", nargs="+", choices=COMPARED, default=list(COMPARED))
    parser.add_argument("--noise", type=float, default=5e-4, help="of the stroke, rms")
    options = parser.parse_args()
    errors = []
    for seed in options.seeds:
        for name in options.effects:
            case = Case("effects", (name,), seed, options.noise)
            plant, _ = case.player()
            assert isinstance(plant, Plant)
            found = diagnose(case.experiment())
            if found.names != (name,) or found.model is None:
                print(f"{name} seed {seed}: {found.verdict} {' '.join(found.names)}, not compared", flush=True)
                continue
            truth = truth_of(plant, found.model)
            for effect in found.effects():
                for parameter, row in effect["parameters"].items():
                    key = f"{effect['law']}.{parameter}"
                    if key in truth:
                        low, high = row["interval_95"]
                        errors.append(2.0 * (row["value"] - truth[key]) / max(high - low, 1e-300))
                        said = "holds" if low <= truth[key] <= high else "excludes"
                        print(f"{key} seed {seed}: {low:.6g} to {high:.6g} {said} {truth[key]:.6g}", flush=True)
    held = np.abs(errors) <= 1.0
    print(f"{held.sum()} of {held.size} intervals contain the truth; error over half width, rms {np.std(errors):.2f}")


if __name__ == "__main__":
    main()
