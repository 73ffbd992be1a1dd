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

"""`make demo`: a stage with a hidden effect is identified, followed live, diagnosed and driven, over real ROS 2.

Driver, model, identification and compensation node run as separate processes. A seed determines the effect. It is
written to a plant file that only the driver reads, and shown here after the verdict.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import picture
import rclpy
import scan
import yaml
from bench import Bench, Trace
from numpy.typing import NDArray
from probe import probe
from processes import Processes
from rclpy.signals import SignalHandlerOptions
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from scan import Scan
from truth import in_numbers_of

from piezo_hysteresis import Model, load
from piezo_hysteresis.identification import DriveLimits
from piezo_hysteresis.nodes.messages.conversions import values_of
from piezo_hysteresis.stage.plant import PlantParameters

ROOT = Path(__file__).parents[2]
NAMESPACE = "/demo"
LIMITS = DriveLimits()
ZEROED = 0.5
"""Time in which the model node measures the zero of the sensor, while the stage rests [s]."""
PATIENCE = 600.0
"""Longest wait for a protocol or a fit [s]."""
signalled: list[int] = []
"""Signals that asked the demo to end."""


class Demo:
    """The steps of the demonstration, in order.

    Parameters
    ----------
    folder : pathlib.Path
        Where everything is written.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.console = Console(highlight=False, soft_wrap=True)
        self.begin = time.monotonic()
        self.parts: dict[str, NDArray] = probe(LIMITS)
        self.traces: dict[str, Trace] = {}
        self.conclusion = ""
        self.scan: Scan | None = None

    def say(self, text: str) -> None:
        """Print a line with the time since the start."""
        self.console.print(f"[dim]{time.monotonic() - self.begin:6.1f} s[/dim]  {text}")

    def start(self, processes: Processes, speed: float, protocol: str, seed: int) -> Bench:
        """Start the nodes; the model node begins with the numbers of the paper."""
        plant = self.folder / "plant.yaml"
        processes.start(
            "driver_node",
            real_time_factor=speed,
            block_duration=0.01 * speed,  # 100 messages a second, as in real time
            command_max_age=30.0,  # to send 80 MB of staircase takes long on a busy machine
            simulated__plant_file=plant,
            simulated__seed=seed,
        )
        processes.start("model_node", model_file=ROOT / "config" / "published_stage.yaml")
        processes.start("identification_node", protocol=protocol, experiment_root=self.folder / "experiments")
        processes.start(
            "compensation_node",
            approximate=True,  # an effect without an inverse is left out, and contained in the expected error
            approach=scan.APPROACH,
            way_back=scan.APPROACH,
            learning_rounds=scan.ROUNDS,
        )
        processes.start("page_node", port=0)
        ids = ", ".join(f"{name} {number}" for name, number in processes.ids.items())
        self.say(f"five processes in {NAMESPACE}, ROS domain {os.environ['ROS_DOMAIN_ID']}: {ids}")
        return Bench(NAMESPACE, LIMITS.sample_period, processes.check)

    def show_page(self, bench: Bench, log: Path) -> None:
        """Print the address of the live page, which shows the stage while the demo runs."""
        bench.wait(lambda: "http://" in log.read_text(), "the live page", PATIENCE)
        address = log.read_text().partition("http://")[2].split()[0]
        self.say(f"live page: http://{address} in a browser on this machine, while the demo runs")

    def look(self, bench: Bench, name: str, model: Model) -> None:
        """Play the probe and show the residual of the model node, which follows `model`.

        After earlier motion the zero is measured again: remanence that it has removed is an offset, and no error.
        """
        if self.traces:
            bench.call("zero")
            bench.pause(ZEROED)
        trace = bench.play(np.concatenate(list(self.parts.values())), "probe")
        self.traces[name] = trace
        before = next(iter(self.traces.values())).rms
        bar = "█" * max(1, round(40 * trace.rms / before))
        chain = ", ".join(effect.name for effect in model.effects)
        self.say(f"[bold]live residual {trace.rms * 1e9:7.1f} nm[/bold] rms  {bar}  {name}: {chain}")

    def plan(self, bench: Bench) -> str:
        """The plan of the identification node; nothing moves."""
        while not (answer := bench.call("plan")).success:
            self.say(answer.message)
            bench.pause(1.0)
        return str(answer.message)

    def run_job(self, bench: Bench, service: str) -> dict[str, str]:
        """Call a service of the identification node and show its progress until it is done."""
        answer = bench.call(service)
        if not answer.success:
            raise RuntimeError(f"{service}: {answer.message}")
        columns = (TextColumn("          {task.description:44.44s}"), BarColumn(24), TimeElapsedColumn())
        values: dict[str, str] = {}

        def finished() -> bool:
            nonlocal values
            values = {} if bench.status is None else values_of(bench.status)
            return values.get("state") in ("done", "failed", "aborted")

        bench.status = None
        with Progress(*columns, console=self.console, transient=True) as shown:
            task = shown.add_task(service, total=100.0)
            for _ in bench.until(finished, service, PATIENCE):
                if bench.status is not None:
                    doing = values.get("phase") or bench.status.message
                    percent = float(values.get("percent", 0))
                    shown.update(task, description=f"{values.get('state')}: {doing}", completed=percent)
        assert bench.status is not None
        if values["state"] != "done":
            raise RuntimeError(f"{service} {values['state']}: {bench.status.message}")
        return {**values, "verdict": bench.status.message}

    def run(self, bench: Bench) -> Path:
        """From the published numbers to the verdict; returns the path of the experiment."""
        self.look(bench, "paper", load(ROOT / "config" / "published_stage.yaml"))
        self.say(f"plan: {self.plan(bench)}")

        count = len(bench.models)
        values = self.run_job(bench, "identify")
        experiment = Path(values["experiment"])
        self.say(f"identified: {values['verdict']}; recorded in {os.path.relpath(experiment)}")
        identified = bench.new_model(count)
        self.look(bench, "identified", identified)
        self.scan = Scan(bench, LIMITS, identified)
        self.scan.linear(identified)
        self.scan.follow("identified model")
        self.say("scanned with a linear gain, and through the inverse of the identified model")

        count = len(bench.models)
        values = self.run_job(bench, "diagnose")
        self.conclusion = values["conclusion"]
        self.say(f"[bold]verdict: {values['verdict']}[/bold]")
        self.look(bench, "extended", bench.new_model(count))
        self.scan.follow("extended model")
        self.scan.learn("learning")
        self.scan.show(self.console)
        return experiment

    def report(self, experiment: Path) -> None:
        """Figures and the page."""
        assert self.scan is not None
        self.scan.save(self.folder)
        picture.save(self.folder / "residual.png", self.parts, LIMITS.sample_period, self.traces)
        command = [sys.executable, "-m", "piezo_hysteresis.cli.main", "report", os.path.relpath(experiment)]
        for label, file in (("identified", "identification.yaml"), ("extended", "diagnosis.yaml")):
            command += ["--model", f"{label}={experiment / file}"]
        if (experiment / "answer.json").exists():
            command += ["--answer", experiment / "answer.json"]
        subprocess.run([*command, "--force", "-o", self.folder / "report.html"], check=True, stdout=subprocess.DEVNULL)
        self.say(f"written: {os.path.relpath(self.folder)}/report.html, residual.png, scan.png, scan.csv")

    def reveal(self, experiment: Path) -> None:
        """Print the hidden effect, and what it is in the units of the model that was found."""
        text = (self.folder / "plant.yaml").read_text()
        first = text.partition("\n")[0].removeprefix("# ")
        self.say(f"[bold]the plant file opens: {first}[/bold]")
        if (experiment / "diagnosis.yaml").exists():
            hidden = {name: float(value) for name, value in re.findall(r"([\w.]+) = ([^,)]+)", first)}
            stage = PlantParameters.from_mapping(yaml.safe_load(text))
            same = in_numbers_of(load(experiment / "diagnosis.yaml"), stage, hidden)
            for name, value in same.items():
                self.say(f"in the units of the model, this is {name} = {value:.4g}")
        self.say("like every simulated stage it also has an amplifier with a pole of its own, at 10 kHz")
        if self.conclusion == "nothing_missing":
            self.say("the identified model contained it already: its residual was at the noise before the search")


def interrupt(number: int, frame: object) -> None:
    """End like Ctrl-C, the nodes first; rclpy may replace the exception that is raised here by another one."""
    signalled.append(number)
    raise KeyboardInterrupt


def main() -> int:
    """Run the demo; returns 0 if it was completed, for every verdict."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, default=1, help="draws the hidden effect (default: 1)")
    parser.add_argument("--effect", help="hide this effect; the seed then draws its size only")
    parser.add_argument(
        "--protocol", default="short", help="paper, short (18 s of stage time, default) or rich (160 s)"
    )
    parser.add_argument("--speed", type=float, default=2.0, help="stage time over real time (default: 2)")
    parser.add_argument("-o", "--output", type=Path, default=ROOT / "demo", help="folder (default: demo)")
    arguments = parser.parse_args()

    folder = arguments.output.resolve()
    if (folder / "experiments").exists():
        print(f"The results of an earlier demo in {folder} are replaced; --output FOLDER keeps them.")
    shutil.rmtree(folder / "experiments", ignore_errors=True)
    folder.mkdir(parents=True, exist_ok=True)
    hide = [sys.executable, ROOT / "examples" / "hide_effect.py", str(arguments.seed), folder / "plant.yaml"]
    subprocess.run([*hide, *(["--name", arguments.effect] if arguments.effect else [])], check=True)

    os.environ.setdefault("ROS_DOMAIN_ID", str(1 + os.getpid() % 100))
    for ending in (signal.SIGINT, signal.SIGTERM):  # also if a shell has made the process ignore them
        signal.signal(ending, interrupt)
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    demo = Demo(folder)
    with ExitStack() as stack:
        stack.callback(rclpy.try_shutdown)
        processes = stack.enter_context(Processes(NAMESPACE, folder / "log"))
        bench = demo.start(processes, arguments.speed, arguments.protocol, arguments.seed)
        demo.show_page(bench, folder / "log" / "page_node.log")
        experiment = demo.run(bench)
    demo.say("the nodes have ended, the stage is at its safe voltage; `scripts/run page_node` shows stages that run")
    demo.report(experiment)
    demo.reveal(experiment)
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except (KeyboardInterrupt, RuntimeError, TimeoutError) as error:
        sys.exit("demo: interrupted; the nodes have ended" if signalled else f"demo: {error}")
