"""A stage that settled with a remanent state: a term of the Bouc-Wen loop."""

from __future__ import annotations

from ...parameter import Parameter
from ..effect import ChainPosition, Term
from ..invertibility import Invertibility


class InitialState(Term):
    """The hysteresis state at the start of every record that does not continue another record.

    Parameters
    ----------
    h0 : float
        h at the start [normalised, 1]; at most |A|/(β + γ sgn A) in size.
    """

    name = "initial_state"
    invertibility = Invertibility.EXACT
    family = "hysteresis"
    place = ChainPosition.HYSTERESIS
    host = "bouc_wen"
    equation = "h(0) = h0"
    signature = (
        "The residual is large at the start of a record only and vanishes after the first large swing. "
        "Demagnetise the stage before a record"
    )
    source = "initial condition of paper, Eq. (2)"
    parameters = (Parameter("h0", "h0", "1", 0.0, -1.0, 1.0, "remanent hysteresis state", "paper, Eq. (2)", 0.0, 0.05),)
