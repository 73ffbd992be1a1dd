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

"""The parameter `axes` of the page node."""

import pytest

from piezo_hysteresis.errors import ParameterError
from piezo_hysteresis.nodes.page.page_node import main, namespace


@pytest.mark.parametrize("given", ["a b", "/x-y", "1a", "a//b", "~", "{x}", "x" * 240, "\u00e9"])
def test_an_invalid_namespace_is_refused_in_one_line(given):
    with pytest.raises(ParameterError, match=r"^axes: got '.*', expected a namespace"):
        namespace(given)


def test_an_invalid_namespace_ends_the_node_without_a_traceback(monkeypatch, capfd):
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")
    assert main(["--ros-args", "-p", "axes:=/stage_x,a b", "-p", "port:=0"]) == 2
    assert capfd.readouterr().err.startswith("axes: got 'a b', expected a namespace")


@pytest.mark.parametrize(("given", "name"), [("stage_x", "/stage_x"), ("/a/b/", "/a/b"), ("/", "/")])
def test_a_namespace_is_made_absolute(given, name):
    assert namespace(given) == name
