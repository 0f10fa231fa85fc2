"""What a rendering will cost: ``python -m figures plan --samples 1e12``."""

import argparse
import contextlib
import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from figures._options import command, count
from figures.commands.calibrate import calibration
from figures.commands.cost_model import MEMORY, TIME, CostModel, Prediction, Sizes, fitted
from figures.making import store
from figures.making.fingerprint import fingerprint
from figures.making.this_machine import machine
from figures.shared.rivals import RIVALS, SCENES
from qmcjax import progress_bar

FILE = "calibration.json"
"""In the output folder: what was measured, until the code or the machine changes."""

INDICES = 2**31
"""Samples in one pass, at most: half of the indices that most sequences have."""

MIB = 2**20


class Plan(NamedTuple):
    """A rendering in passes, and what it will cost."""

    passes: int
    sizes: Sizes
    """Of a pass."""
    seconds: Prediction
    """Of all passes, without start and compilation."""
    once: float
    """Seconds of start and compilation."""
    bytes: Prediction
    """Of one process."""

    @property
    def total(self) -> tuple[float, float, float]:
        """Seconds of all, with its spread."""
        return (
            self.once + self.seconds.value,
            self.once + self.seconds.low,
            self.once + self.seconds.high,
        )


def main(argv: Sequence[str]) -> int:
    """Measure for a minute, if that was not done before, and print what the rendering will cost."""
    parser = _parser()
    given = parser.parse_args(argv)
    needs = len(SCENES[given.scene]().needs)
    if RIVALS[given.sampler].make(needs, 64, 64, 16, 1).dims < needs:
        parser.error(f"--sampler {given.sampler} has fewer dimensions than {given.scene} needs, {needs}")
    if given.samples < given.size**2:
        parser.error(
            f"--samples must be at least one for each of {given.size}^2 pixels, got {given.samples:g}"
        )
    try:
        store.prepare(given.out)
    except OSError as error:
        parser.error(f"--out {str(given.out)!r} cannot be written: {error}")
    try:
        found = _calibrated(given.scene, given.sampler, given.out)
    except RuntimeError as error:
        parser.error(str(error))
    time, memory = models(found)
    plan = planned(found, time, memory, given)
    print("\n".join(report(found, time, memory, plan, given)))
    return 0


def _calibrated(scene: str, sampler: str, folder: Path) -> dict[str, Any]:
    """Return what was measured before with this code on this machine, or measure."""
    path = folder / FILE
    known: dict[str, Any] = {}
    with contextlib.suppress(FileNotFoundError, ValueError):  # What is damaged is measured again.
        known = json.loads(path.read_text())
    code, name = fingerprint("figures.commands.calibrate", json.dumps(machine())), f"{sampler} in {scene}"
    if known.get(name, {}).get("code") != code:
        known[name] = {"code": code, **calibration(scene, sampler, progress_bar("measuring"))}
        store.write(path, json.dumps(known, indent=1).encode())
        known = json.loads(path.read_text())
    return known[name]


def _read(rows: list[Any]) -> list[tuple[Sizes, float]]:
    return [(Sizes(*sizes), value) for sizes, value in rows]


def models(found: dict[str, Any]) -> tuple[CostModel, CostModel]:
    """Return the fits of time and of memory."""
    return fitted(TIME, _read(found["time"])), fitted(MEMORY, _read(found["memory"]))


def errors(model: CostModel, rows: list[Any]) -> list[tuple[Sizes, float]]:
    """Return relative errors of predictions for sizes that are not in the fit."""
    return [(sizes, model.predict(sizes).value / value - 1) for sizes, value in _read(rows)]


def planned(found: dict[str, Any], time: CostModel, memory: CostModel, given: argparse.Namespace) -> Plan:
    """Return the passes that make up all samples, and what they cost."""
    pixels = given.size**2
    spp = math.ceil(given.samples / pixels)
    # Powers of two suit most samplers.
    most = 2 ** max((INDICES // pixels).bit_length() - 1, 0)
    passes = math.ceil(spp / most)
    dims = Sizes(*found["memory"][0][0]).dims
    sizes = Sizes(pixels, min(spp, most), dims, given.devices)
    one = time.predict(sizes)
    whole = Prediction(passes * one.value, passes * one.low, passes * one.high, one.shares)
    # Processes start, and compile, at the same time.
    return Plan(passes, sizes, whole, found["start"] + found["compilation"], memory.predict(sizes))


def report(
    found: dict[str, Any], time: CostModel, memory: CostModel, plan: Plan, given: argparse.Namespace
) -> list[str]:
    """Return the lines that are printed."""
    total, low, high = plan.total
    sizes, one = plan.sizes, found["machine"]["processor"] if found["one core"] else found["device"]
    in_passes = f" in {plan.passes} passes of {sizes.spp}" if plan.passes > 1 else ""
    shares = {name: share for name, share in plan.seconds.shares.items() if share >= 0.001}
    held = errors(time, found["held out"])
    held_memory = errors(memory, found["memory held out"])
    processes = f"{given.processes} processes" if given.processes > 1 else "1 process"
    each = plan.bytes.value * plan.bytes.shares["pixels"] / sizes.pixels
    lines = [
        f"{given.samples:g} samples of {given.scene} by {given.sampler}: {given.size} x {given.size} pixels, "
        f"{math.ceil(given.samples / sizes.pixels)} samples each{in_passes}",
        f"on {given.devices} x {'one core of ' if found['one core'] else ''}{one}, {processes}",
        "",
        f"time         {duration(total)} ({duration(low)} to {duration(high)})",
        f"  start      {found['start']:.1f} s, compilation {found['compilation']:.1f} s: "
        f"{plan.once / total:.2g} of all",
        "  of a pass  " + ", ".join(f"{name} {share:.1%}" for name, share in shares.items()),
        f"memory       {given.processes * plan.bytes.value / MIB:.0f} MiB "
        f"({given.processes * plan.bytes.low / MIB:.0f} to {given.processes * plan.bytes.high / MIB:.0f}): "
        f"{plan.bytes.shares['process'] * plan.bytes.value / MIB:.0f} MiB and {each:.0f} bytes per pixel, "
        f"{processes}",
        "",
        f"fit of {len(found['time'])} times, scatter {time.scatter:.1%}; errors at sizes held out:",
        *(f"  {_shown(sizes)}: {error:+.1%}" for sizes, error in held),
        *(f"  memory, {sizes.pixels} pixels: {error:+.1%}" for sizes, error in held_memory),
    ]
    if given.devices > 1 and not any(Sizes(*sizes).devices > 1 for sizes, _ in found["time"]):
        lines.append("what devices take from each other was not measured: taken for nothing")
    return lines


def _shown(sizes: Sizes) -> str:
    what = "" if sizes.scene else f", {sizes.dims} coordinates alone"
    return f"{sizes.pixels} pixels, {sizes.spp} spp, {sizes.devices} device{'s' * (sizes.devices > 1)}{what}"


def duration(seconds: float) -> str:
    """Return a time in the two units that suit it."""
    if seconds < 59.95:
        return f"{seconds:.1f} s"
    for large, small, size, part, limit in (("min", "s", 60, 1, 3600), ("h", "min", 3600, 60, 86400)):
        rounded = round(seconds / part) * part
        if rounded < limit:
            return f"{rounded // size} {large} {rounded % size // part} {small}"
    hours = round(seconds / 3600)
    return f"{hours // 24} d {hours % 24} h"


def _parser() -> argparse.ArgumentParser:
    parser = command(
        "plan",
        "Time and memory of a rendering, by a model that is fitted to a minute of measurements "
        f"on this machine. They are kept in {FILE} in the output folder.",
        f"""\
A device is one core of the processor, or the accelerator. More of them share the pixels. The spread is twice
the standard error of the fit; errors at sizes that were held out of it are printed, too. More samples than
a sequence has indices for are taken in passes, each with a key of its own.

samplers: {", ".join(RIVALS)}
scenes: {", ".join(SCENES)}
""",
    )
    parser.add_argument(
        "--samples", type=_samples, required=True, metavar="N", help="of all pixels, as in 1e12"
    )
    parser.add_argument(
        "--size", type=count, default=1024, metavar="N", help="side of the image (default: 1024)"
    )
    parser.add_argument(
        "--scene", choices=SCENES, default="zone-plate", metavar="NAME", help="(default: zone-plate)"
    )
    parser.add_argument(
        "--sampler", choices=RIVALS, default="hilbert", metavar="NAME", help="(default: hilbert)"
    )
    parser.add_argument("--devices", type=count, default=1, metavar="N", help="(default: 1)")
    parser.add_argument("--processes", type=count, default=1, metavar="N", help="(default: 1)")
    parser.add_argument(
        "--out",
        type=Path,
        default=Path("out"),
        metavar="DIR",
        help="folder for what is measured (default: out)",
    )
    return parser


def _samples(text: str) -> float:
    try:
        samples = float(text)
    except ValueError:
        samples = math.nan
    if not 1 <= samples < math.inf:
        raise argparse.ArgumentTypeError(f"must be a number of at least 1, got {text!r}")
    return samples
