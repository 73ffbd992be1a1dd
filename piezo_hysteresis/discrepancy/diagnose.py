"""`diagnose`: a loop over the passes of `passes`, up to the one that knows the answer."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from ..effects import CATALOGUE, Effect
from ..errors import IdentificationError
from ..identification.fit.fit import Progress
from ..identification.one_core import on_one_core
from ..model.model import Model
from ..record import Experiment
from .diagnosis import Diagnosis
from .passes import PASSES, PASSES_ON_SIMULATED_DATA, DiagnosisState


@on_one_core
def diagnose(
    experiment: Experiment,
    model: Model | None = None,
    *,
    effects: Collection[type[Effect]] = CATALOGUE,
    progress: Progress | None = None,
    explicit_step: bool = False,
) -> Diagnosis:
    """Find where simulation and measurement disagree, name the missing effect, add it, and show the gap shrink.

    Parameters
    ----------
    experiment : Experiment
        Records of any kind; the more kinds, and the more realisations of each, the surer the name.
    model : Model, optional
        Where the search begins; identified from the experiment by default.
    effects : collection of Effect classes
        The library to choose from; the whole catalogue by default.
    progress : callable, optional
        Called with a word and the fraction done.
    explicit_step : bool
        True for data of a simulation that takes the explicit step of Eq. (7): if the data agree, what that step
        changes is taken out before anything is named. No real stage needs it.

    Returns
    -------
    Diagnosis
        Named, nothing missing, or unknown, with the extended model.

    Raises
    ------
    IdentificationError
        If nothing in the experiment moves.
    ModelError
        If the records are faster than the model.
    """
    state = DiagnosisState(experiment, model, effects, progress or (lambda word, fraction: None))
    with np.errstate(over="ignore", invalid="ignore"):  # diverging trials show in their cost
        for run in PASSES_ON_SIMULATED_DATA if explicit_step else PASSES:
            found = run(state)
            if isinstance(found, Diagnosis):
                return found
            state = found
    raise IdentificationError("diagnose: got no answer from the last pass, expected a diagnosis")
