"""`axis_node`: driver, model and identification node of one axis in one process and one thread of callbacks.

One process less to start and to find; in exchange a fit that ends or a model that is loaded keeps the others waiting.
The names of the nodes, their topics, services and parameters are those of the three processes.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence

from .driver.driver_node import DriverNode
from .identification.identification_node import IdentificationNode
from .model.model_node import ModelNode
from .runtime.process import NodeLife, run_together


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the three nodes; the exit code is 2 where their parameters make no sense."""
    lives: list[NodeLife] = [
        NodeLife(DriverNode, DriverNode.begin, DriverNode.end),
        NodeLife(ModelNode, end=ModelNode.end),
        NodeLife(IdentificationNode, end=IdentificationNode.end),
    ]
    return run_together(lives, arguments)


if __name__ == "__main__":
    sys.exit(main())
