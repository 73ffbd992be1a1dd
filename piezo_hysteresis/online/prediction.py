"""`Prediction`: prediction and residual of one block of samples."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..model.model import Model

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, slots=True)
class Prediction:
    """Prediction and residual of one block.

    Parameters
    ----------
    first : int
        First sample of the block that counts; those before it were repeated.
    prediction, residual : (n,) ndarray
        Predicted displacement, and measured minus predicted [m], of the samples from `first` on; empty without a model.
    model : Model or None
        Model they come from.
    warming_up : bool
        True while what the drive did unseen still matters: before the first block, or in a gap.
    """

    first: int
    prediction: Array
    residual: Array
    model: Model | None
    warming_up: bool
