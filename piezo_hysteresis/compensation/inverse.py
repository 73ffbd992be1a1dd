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

"""`Inverse`: the inverse of a model. It computes the drive voltage for a wanted displacement."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..blocks.block import Block, State
from ..blocks.inverses.held_deviation import HeldDeviation
from ..blocks.inverses.inverted_block import InvertedBlock
from ..blocks.inverses.linear_inverse import InvertedLinear
from ..c_form import CForm
from ..effects import ChainPosition, Invertibility
from ..errors import ModelError
from ..inverse_terms import InverseTerms
from ..model.chain import ChainState
from ..model.model import Model
from ..model.samples import samples
from .band import Band
from .limits import Limits
from .nonlinear_part import NonlinearPart, RecursionState

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class InverseState:
    """State of an inverse between two blocks of samples.

    Parameters
    ----------
    stages : tuple
        States of the inverted blocks, the sensor first.
    nonlinear : tuple of ndarray
        State of the part that is nonlinear in the last sample.
    start_time : float
        Time of the first drive sample [s].
    count : int
        Number of samples since `start_time`.
    """

    stages: tuple[State, ...]
    nonlinear: RecursionState
    start_time: float
    count: int


class Inverse:
    """The inverse of a model, at the sample period of the model.

    Parameters
    ----------
    model : Model
        Model of the stage.
    limits : Limits, optional
        Limits of the drive; they act inside the recursion. Default: no limits.
    band : Band, optional
        Low-pass filter of the wanted displacement. Default: no filter; the fast parts of a path may then need very high
        voltages.
    approximate : bool
        Leave out effects that cannot be inverted instead of refusing the model; see `HeldDeviation`.

    Attributes
    ----------
    preview : int
        Number of samples of the wanted displacement that must be known in advance.
    is_exact : bool
        False if an effect was left out or has an approximate inverse, or if the hysteresis output would fall while the
        drive rises, at a speed that the limits allow.
    left_out : tuple of str
        Effects that have no inverse and were left out.
    not_on_path : tuple of str
        Effects that the drive voltage does not influence.
    ends : (float, float)
        Lowest and highest normalised drive; where no voltage gives what is wanted, the drive is at one of them.
    noise_gain : float
        Largest factor by which rounding errors of the wanted displacement grow in the drive.

    Raises
    ------
    ModelError
        If the chain contains an effect without an inverse and `approximate` is not set, or two forms of one part of the
        amplifier.

    Examples
    --------
    >>> from piezo_hysteresis.effects import Arx, BoucWen
    >>> model = Model((BoucWen(), Arx(b=[0.5], delay=2)), sample_period=2e-5)
    >>> inverse = Inverse(model)
    >>> inverse.preview
    2
    >>> y = 0.05 * (1.0 - np.cos(np.arange(100) / 9.0))
    >>> u, _ = inverse.run(np.append(y, [y[-1], y[-1]]), inverse.rest(0.0))
    >>> reached, _ = model.run(u, model.rest(0.0))
    >>> bool(np.allclose(reached[2:], y, rtol=0.0, atol=1e-15))
    True
    """

    def __init__(
        self, model: Model, limits: Limits | None = None, *, band: Band | None = None, approximate: bool = False
    ) -> None:
        impossible = [e.name for e in model.effects if e.invertibility is Invertibility.IMPOSSIBLE and not e.is_off]
        if impossible and not approximate:
            raise ModelError(
                f"{', '.join(impossible)}: cannot be inverted; expected a model without it, or approximate=True, which "
                "leaves it out and predicts the resulting error"
            )
        self.model, self.limits, self.left_out = model, limits or Limits(), tuple(impossible)
        self.sample_period, self.chain = model.sample_period, model.at(model.sample_period)
        possible = [e for e in model.effects if e.invertibility is not Invertibility.IMPOSSIBLE]
        # another form of an effect of the drive can take the place of one that is switched off
        used = tuple(e for e in possible if e.place is not ChainPosition.DRIVE or not e.is_off)
        kept = Model(used, model.sample_period, model.voltage_scale, model.displacement_scale).at(model.sample_period)
        self.not_on_path = tuple(e.name for e in model.effects if e.invertibility is Invertibility.NOT_NEEDED)
        terms = _terms_of_nonlinear_part(kept.blocks, kept.labels)
        self._nonlinear = NonlinearPart(terms, self.limits, self.sample_period)
        self.ends = self._nonlinear.ends
        numbers = [self.chain.labels.index(label) for label in kept.labels]  # the states are those of the whole model
        numbered = list(zip(numbers, kept.blocks, strict=True))
        self._before, after = numbered[: len(terms)], numbered[len(terms) :]
        own = [(k, _inverted(b, self.chain.labels[k], self.chain.blocks[k])) for k, b in after]
        own += [(k, HeldDeviation(b)) for k, b in enumerate(self.chain.blocks) if self.chain.labels[k] in impossible]
        own.sort(key=lambda item: -item[0])
        inverted: list[tuple[int | None, InvertedBlock]] = [(k, stage) for k, stage in own if stage is not None]
        if band is not None:
            inverted.insert(0, (None, band.stage(self.sample_period)))
        self._stages = inverted
        previews = [stage.preview for _, stage in inverted]
        self._ahead = [sum(previews[k + 1 :]) for k in range(len(previews))]
        self.preview = sum(previews)
        recursive = [e for e in model.effects if e.place in (ChainPosition.DRIVE, ChainPosition.HYSTERESIS)]
        exact = all(e.is_off or e.invertibility is Invertibility.EXACT for e in recursive)
        exact = exact and self._nonlinear.rises_at_every_speed
        self.is_exact = exact and not impossible and all(stage.is_exact for _, stage in inverted)
        self.noise_gain = float(np.prod([stage.noise_gain for _, stage in inverted]))

    @property
    def preview_time(self) -> float:
        """`preview` in seconds."""
        return self.preview * self.sample_period

    def rest(self, voltage: float, time: float = 0.0) -> InverseState:
        """State of a stage settled at `voltage` [V]; `time` is that of the first drive sample [s]."""
        return self.resume(self.chain.rest(voltage, time))

    def resume(self, state: ChainState) -> InverseState:
        """State of the inverse for a stage whose model is in `state`; a softened mode is taken as settled.

        ModelError for the state of a model of other effects.
        """
        self.chain.require_own(state)
        started = tuple(
            stage.start(state.inputs[-1 if k is None else k], None if k is None else state.blocks[k], ahead)
            for (k, stage), ahead in zip(self._stages, self._ahead, strict=True)
        )
        if self._stages and self._stages[0][0] is None:
            reading = self.chain.blocks[-1].static(state.inputs[-1])
            started = (self._stages[0][1].start(reading, None, self._ahead[0]), *started[1:])
        before = [(block, state.inputs[k], state.blocks[k]) for k, block in self._before]
        nonlinear = self._nonlinear.start(*zip(*before, strict=True))
        return InverseState(started, nonlinear, state.time, 0)

    def run(self, wanted: ArrayLike, state: InverseState) -> tuple[Array, InverseState]:
        """Drive voltage of the next samples.

        The result does not depend on how the path is cut into blocks, bit for bit.

        Parameters
        ----------
        wanted : (n,) array_like
            Displacement [m]; its sample i is reached by the drive sample i + `preview` of the output.
        state : InverseState
            State from `rest`, from `resume`, or after the block before.

        Returns
        -------
        voltage : (n,) ndarray
            Drive [V].
        state : InverseState
            State after these samples.

        Raises
        ------
        ModelError
            If samples are empty or not finite.
        """
        y = np.ascontiguousarray(samples(wanted, "displacement")).copy()
        index, states = state.count + np.arange(y.size, dtype=np.float64), []
        for (_, stage), ahead, own in zip(self._stages, self._ahead, state.stages, strict=True):
            time = np.asarray(state.start_time + self.sample_period * (index + ahead), dtype=np.float64)
            y, own = stage.run(y, own, time)
            states.append(own)
        u, nonlinear = self._nonlinear.run(y, state.nonlinear)
        return u, InverseState(tuple(states), nonlinear, state.start_time, state.count + y.size)

    def command(self, wanted: ArrayLike, state: InverseState) -> tuple[Array, InverseState]:
        """Drive voltage (n + preview,) [V] for a whole path (n,) [m] whose end is held, and the state after it.

        The stage reaches the first sample of the path `preview` samples after the first sample of the drive.
        """
        path = samples(wanted, "displacement")
        return self.run(np.append(path, np.full(self.preview, path[-1])), state)

    def c_forms(self) -> dict[str, tuple[int | None, CForm | str]]:
        """C code of every stage in order, by name, with the number of the block that it inverts.

        The number is None for the band, which rests at the displacement. The last stage, with number 0, inverts all
        blocks before the dynamics.
        """
        labels = self.chain.labels
        found: dict[str, tuple[int | None, CForm | str]] = {
            "band" if k is None else labels[k]: (k, stage.c_form(ahead))
            for (k, stage), ahead in zip(self._stages, self._ahead, strict=True)
        }
        return found | {"drive": (0, self._nonlinear.c_form())}


def _terms_of_nonlinear_part(blocks: Sequence[Block], labels: Sequence[str]) -> list[InverseTerms]:
    """Terms of drive, hysteresis and creep, which are the blocks before the first block of the dynamics.

    Raises
    ------
    ModelError
        If a block of the drive has no terms, or the same ones as another.
    """
    scale, terms, owners = labels.index("voltage_scale"), list[InverseTerms](), dict[str, str]()
    for k, block in enumerate(blocks):
        own = block.inverse_terms()
        if own is None and k < scale:
            raise ModelError(
                f"{labels[k]}: {type(block).__name__} has no inverse; expected `inverse_terms` of the drive"
            )
        if own is None or (k > scale and own.drive):
            break
        for other in {owners[name] for name in own.drive if name in owners}:
            raise ModelError(f"{labels[k]}: cannot be inverted together with {other}; expected one of them")
        owners |= dict.fromkeys(own.drive, labels[k])
        terms.append(own)
    return terms


def _inverted(block: Block, label: str, whole: Block) -> InvertedBlock | None:
    """The inverse that a block declares, by its sections or in `Block.inverted`; `whole` is that of the whole model."""
    if sections := block.sections():
        return InvertedLinear(block, sections, label, type(whole) is type(block))
    return block.inverted(label)
