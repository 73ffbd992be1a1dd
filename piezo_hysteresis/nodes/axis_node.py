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

"""`axis_node`: driver, model and identification node of one axis in one process and one thread of callbacks.

There are fewer processes to start and to discover. In exchange, the other nodes wait while a fit ends or a model is
loaded. The names of the nodes, their topics, services and parameters are those of the three processes.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence

from .driver.driver_node import DriverNode
from .identification.identification_node import IdentificationNode
from .model.model_node import ModelNode
from .runtime.process import NodeLife, run_together


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the three nodes; the exit code is 2 where their parameters are invalid."""
    lives: list[NodeLife] = [
        NodeLife(DriverNode, DriverNode.begin, DriverNode.end),
        NodeLife(ModelNode, end=ModelNode.end),
        NodeLife(IdentificationNode, end=IdentificationNode.end),
    ]
    return run_together(lives, arguments)


if __name__ == "__main__":
    sys.exit(main())
