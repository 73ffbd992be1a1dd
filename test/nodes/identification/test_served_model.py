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

"""A model as parameters of a node: whole, typed, described, and written by nobody else."""

import pytest
from rcl_interfaces.msg import ParameterType, SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter

from piezo_hysteresis.effects import Arx, BoucWen, Creep
from piezo_hysteresis.errors import ModelError
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.model.model_file import dumps
from piezo_hysteresis.model.model_parameters import from_parameters, to_parameters
from piezo_hysteresis.nodes.identification.identification_node import START
from piezo_hysteresis.nodes.identification.served_model import ServedModel

MODEL = Model((BoucWen(), Arx(a=[-0.5], b=[0.5])), 2e-5, provenance={"free_run_error": "1e-09", "source": "a test"})


@pytest.fixture
def node(lab):
    """In the context of the lab, spun by nobody."""
    node = Node("served", context=lab.node.context, allow_undeclared_parameters=True)
    yield node
    node.destroy_node()


def values(node):
    return {f"model.{name}": p.value for name, p in node.get_parameters_by_prefix("model").items()}


def test_another_chain_replaces_the_whole_model(node):
    served = ServedModel(node, START)
    assert values(node)["model.valid"] is False
    assert served.model is None
    longer = MODEL.with_effect(Creep(gamma=0.015))
    for model in (MODEL, longer, MODEL):
        served.serve(model)
        assert dumps(from_parameters(values(node))) == dumps(model)
        assert set(values(node)) == set(to_parameters(model))
        assert served.model is model
    served.serve(longer)
    gamma = node.describe_parameter("model.creep.gamma")
    assert gamma.type == ParameterType.PARAMETER_DOUBLE
    assert "[1/decade]" in gamma.description
    assert all(node.describe_parameter(name).description for name in values(node))


def test_served_parameters_are_read_only(node):
    served = ServedModel(node, START)
    served.serve(MODEL)
    for name, value in {"model.bouc_wen.A": 1.0, "model.new": 1.0, "model.valid": False}.items():
        result = node.set_parameters_atomically([Parameter(name, value=value)])
        assert not result.successful
        assert name in result.reason
    assert dumps(from_parameters(values(node))) == dumps(MODEL)


def test_a_model_that_is_refused_changes_nothing(node):
    served = ServedModel(node, START)
    served.serve(MODEL)
    node.add_on_set_parameters_callback(lambda _: SetParametersResult(successful=False, reason="on request"))
    with pytest.raises(ModelError, match="on request"):
        served.serve(MODEL.with_effect(Creep(gamma=0.015)))
    assert served.model is MODEL
    assert dumps(from_parameters(values(node))) == dumps(MODEL)


def test_a_model_given_at_start_is_resumed_and_start_values_are_not(node):
    served = ServedModel(node, START)
    served.resume({"protocol": "short"})
    served.resume(to_parameters(START, valid=False))
    assert served.model is None
    with pytest.raises(ModelError, match=r"'model.bouc_wen.A' is missing"):
        served.resume({n: v for n, v in to_parameters(MODEL).items() if n != "model.bouc_wen.A"})
    assert values(node)["model.valid"] is False
    served.resume(to_parameters(MODEL))
    assert dumps(served.model) == dumps(MODEL)
