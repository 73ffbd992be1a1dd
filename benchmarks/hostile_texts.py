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

"""Texts that are no models and cost a reader time or memory, or crash it: for tests and for the soak."""

from __future__ import annotations


def hostile_texts(good: str) -> dict[str, str]:
    """Texts by their kind; some are changes of the text of a valid model file."""
    return {
        "nothing": "",
        "a zero byte": "\x00",
        "half a character": "a: \ud800",
        "one long word": "a" * 2_000_000,
        "deep brackets": "[" * 10_000,
        "deep braces": "{" * 500_000,
        "deep lists": "- " * 10_000,
        "deep keys": "? " * 20_000,
        "keys without number": "".join(f"k{i}: {i}\n" for i in range(60_000)),
        "anchors": "".join(f"- &a{i} 1\n" for i in range(60_000)),
        "a list without end": good.replace("b: [", "b: [" + "0.1, " * 150_000),
        "a number without end": "a: " + "9" * 900_000,
        "documents without number": "---\n" * 200_000,
        "blank lines": "\n" * 900_000,
        "an alias of itself": "&a [*a]",
        "aliases in one another": "a: &a [x,x,x,x,x]\nb: &b [*a,*a,*a,*a]\nc: &c [*b,*b,*b,*b]\n",
        "merged aliases": "a: &a {x: 1}\nb: {<<: [" + "*a," * 20_000 + "*a]}",
        "an object": "!!python/object/apply:os.system [id]",
        "numbers that are none": good.replace("1", "1e999"),
        "a name that reads like another": good.replace("sample_period", "sample_period\u202e"),
        "the first half": good[: len(good) // 2],
    }
