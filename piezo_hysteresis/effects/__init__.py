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

"""The catalogue of effects: one physical effect per file, listed in the order in which they act.

u → [amplifier] → [backlash] → v → [h with its terms + plays + even polynomial] → w → [creep] →
[delay, G with softening, extra mode] → x → [sensor] → [drift, other axis, hum, zero] → y
"""

from __future__ import annotations

from ..errors import ModelError
from .drive.amplifier_bandwidth import AmplifierBandwidth
from .drive.amplifier_bandwidth_held import AmplifierBandwidthHeld
from .drive.amplifier_saturation import AmplifierSaturation
from .drive.amplifier_slew_limit import AmplifierSlewLimit
from .drive.amplifier_slew_limit_held import AmplifierSlewLimitHeld
from .drive.amplifier_slew_limit_settling import AmplifierSlewLimitSettling
from .drive.backlash import Backlash
from .dynamics.arx import Arx
from .dynamics.extra_delay import ExtraDelay
from .dynamics.extra_resonance import ExtraResonance
from .dynamics.softening import Softening
from .dynamics.softening_of_one_mode import SofteningOfOneMode
from .effect import ChainPosition, Discretisation, Effect, Term
from .environment.axis_coupling import AxisCoupling
from .environment.mains_hum import MainsHum
from .environment.thermal_drift import ThermalDrift
from .environment.thermal_expansion import ThermalExpansion
from .excitation_need import ExcitationNeed
from .hysteresis.asymmetric_hysteresis import AsymmetricHysteresis
from .hysteresis.bouc_wen import BoucWen
from .hysteresis.even_input_polynomial import EvenInputPolynomial
from .hysteresis.hysteresis_exponent import HysteresisExponent
from .hysteresis.hysteresis_memory import HysteresisMemory
from .hysteresis.initial_state import InitialState
from .hysteresis.level_dependent_memory import LevelDependentMemory
from .hysteresis.operator import HysteresisOperator, Loop
from .hysteresis.published_bouc_wen import PublishedBoucWen
from .hysteresis.rate_dependent_hysteresis import RateDependentHysteresis
from .hysteresis.rate_dependent_hysteresis_lagged import RateDependentHysteresisLagged
from .invertibility import Invertibility
from .material import LAWS_OF_CREEP
from .material.creep import Creep
from .material.creep_exponential import CreepExponential
from .material.creep_fractional import CreepFractional
from .material.creep_two_rates import CreepTwoRates
from .sensor.gain_drift import GainDrift
from .sensor.offset import Offset
from .sensor.second_order_low_pass import SecondOrderLowPass
from .sensor.sensor_bandwidth import SensorBandwidth
from .sensor.sensor_nonlinearity import SensorNonlinearity
from .unnamed.unnamed_correction import CorrectionShape, UnnamedCorrection
from .unnamed.unnamed_plays import UnnamedPlays
from .unnamed.unnamed_position_map import UnnamedPositionMap
from .unnamed.unnamed_relaxation import UnnamedRelaxation

CHAIN: tuple[type[Effect], ...] = (
    AmplifierSaturation,
    AmplifierSlewLimit,
    AmplifierSlewLimitHeld,
    AmplifierSlewLimitSettling,
    AmplifierBandwidth,
    AmplifierBandwidthHeld,
    Backlash,
    BoucWen,
    PublishedBoucWen,
    AsymmetricHysteresis,
    HysteresisExponent,
    RateDependentHysteresis,
    RateDependentHysteresisLagged,
    InitialState,
    HysteresisMemory,
    LevelDependentMemory,
    EvenInputPolynomial,
    *LAWS_OF_CREEP,
    ExtraDelay,
    Arx,
    Softening,
    SofteningOfOneMode,
    ExtraResonance,
    UnnamedPositionMap,
    UnnamedPlays,
    UnnamedRelaxation,
    SensorNonlinearity,
    GainDrift,
    SensorBandwidth,
    SecondOrderLowPass,
    ThermalDrift,
    ThermalExpansion,
    AxisCoupling,
    MainsHum,
    Offset,
)
"""Every effect, in the order in which it acts."""

HYSTERESIS: type[HysteresisOperator] = BoucWen
"""The hysteresis that is identified by default."""

MEMORY: type[HysteresisMemory] = HysteresisMemory
"""The effect that is used for a stage whose hysteresis remembers turning points, which one Bouc-Wen state cannot."""

OPERATORS: dict[str, type[HysteresisOperator]] = {e.name: e for e in CHAIN if issubclass(e, HysteresisOperator)}
"""Every operator that can be the hysteresis of a model, by its identifier."""

BASELINE: tuple[type[Effect], ...] = (*OPERATORS.values(), Arx, Offset)
"""The published model, to which the other effects are added."""

FINER_FORMS: tuple[type[Effect], ...] = (
    AmplifierSlewLimitHeld,
    AmplifierSlewLimitSettling,
    RateDependentHysteresisLagged,
    LevelDependentMemory,
    CreepTwoRates,
    SecondOrderLowPass,
)
"""Forms of effects with more parameters, for identified models. The gap finder names the effect and not the form."""

UNNAMED: tuple[type[UnnamedCorrection], ...] = (UnnamedPositionMap, UnnamedPlays, UnnamedRelaxation)
"""Corrections without a physical name, for a residual that no effect explains; a search for effects excludes them."""

CATALOGUE: tuple[type[Effect], ...] = tuple(e for e in CHAIN if e not in (*BASELINE, *FINER_FORMS, *UNNAMED))
"""The effects that can be added to a Hammerstein-MBW model."""

BY_NAME: dict[str, type[Effect]] = {e.name: e for e in CHAIN}
"""Every effect by its identifier."""


def effect_named(name: str) -> type[Effect]:
    """The class of the effect with an identifier.

    Raises
    ------
    ModelError
        If the catalogue has no effect of that name.
    """
    if name not in BY_NAME:
        raise ModelError(f"unknown effect '{name}', expected one of {', '.join(BY_NAME)}")
    return BY_NAME[name]


__all__ = [
    "BASELINE",
    "BY_NAME",
    "CATALOGUE",
    "CHAIN",
    "FINER_FORMS",
    "HYSTERESIS",
    "MEMORY",
    "OPERATORS",
    "UNNAMED",
    "AmplifierBandwidth",
    "AmplifierBandwidthHeld",
    "AmplifierSaturation",
    "AmplifierSlewLimit",
    "AmplifierSlewLimitHeld",
    "AmplifierSlewLimitSettling",
    "Arx",
    "AsymmetricHysteresis",
    "AxisCoupling",
    "Backlash",
    "BoucWen",
    "Creep",
    "CreepExponential",
    "CreepFractional",
    "CreepTwoRates",
    "Effect",
    "ExcitationNeed",
    "EvenInputPolynomial",
    "ExtraDelay",
    "ExtraResonance",
    "GainDrift",
    "HysteresisExponent",
    "HysteresisMemory",
    "HysteresisOperator",
    "InitialState",
    "Invertibility",
    "LevelDependentMemory",
    "Loop",
    "MainsHum",
    "Offset",
    "ChainPosition",
    "PublishedBoucWen",
    "RateDependentHysteresis",
    "RateDependentHysteresisLagged",
    "SecondOrderLowPass",
    "SensorBandwidth",
    "SensorNonlinearity",
    "Discretisation",
    "Softening",
    "SofteningOfOneMode",
    "Term",
    "ThermalDrift",
    "ThermalExpansion",
    "CorrectionShape",
    "UnnamedCorrection",
    "UnnamedPlays",
    "UnnamedPositionMap",
    "UnnamedRelaxation",
    "effect_named",
]
