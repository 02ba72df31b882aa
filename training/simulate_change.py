#!/usr/bin/python3
"""Render streets that are driven twice, for training or measuring change detection, each with a town, weather and camera of its own.

    training/simulate_change.py --out build/training/change --first-seed 30001 --worlds 60
    training/simulate_change.py --out build/training/change_validation --first-seed 40001 --worlds 8 --plain

OUT/SEED/some, none and all are what `livemap simulate --change` leaves (docs/reference/simulator.md) when some objects, none, or
all of those change that can. In a second picture of `none` stands everything that can; what `all` says about the same
picture is the class of each pixel's object (one in five is replaced in `all`, by another class if it stands on the
pavement: there the mask names what replaces it). The encoder is pretrained on these.
Streets that are there already are left as they are, so that a stopped run continues with the same command.
"""

import argparse
import os
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, Dict, List, Optional

import numpy as np
import yaml

sys.path.insert(0, str(Path(__file__).parent))
from streets import busy_street

CONDITIONS = ("day", "day", "dusk", "rain", "snow")
"""By day as often as twice any other weather."""

SPEED_MPS = 8.0
RATE_HZ = 0.55
"""Pairs per second: one about every 15 m."""

HAZARDS = ("traffic_cone", "road_work_sign", "barrier", "debris", "deer", "construction_machine", "stopped_accident")
"""What stands in a street with many hazards; potholes are no change."""

PLAIN_CHANGES = 0.85
"""Share of the objects that change with --plain: about 7 % of the pixels, as in VL-CMU-CD's test pairs (by the thesis's table 4.1:
recall 0.87 at precision 0.38 and a false positive rate of 0.10). F1 at such a rate depends on it."""

MANY_HAZARDS_SHARE = 0.5
"""Streets with many hazards: a street that the seed makes up has few, and cones and barriers have to be learnt too."""


def camera(rng: np.random.Generator) -> Dict[str, Any]:
    """A camera file's content: behind a windscreen, in the size of the network's input or with its padding below."""
    width, height = 320, int(rng.choice([240, 256]))
    focal = float(rng.uniform(210, 310))
    mounting = {
        "forward_m": 0.0, "left_m": 0.0, "height_m": float(rng.uniform(1.25, 2.0)), "roll_deg": float(rng.uniform(-0.7, 0.7)),
        "pitch_deg": float(rng.uniform(1, 9)), "yaw_deg": float(rng.uniform(-4, 4)),
    }
    return {"name": "simulated", "width": width, "height": height, "fx": focal, "fy": focal,
            "cx": (width - 1) / 2, "cy": (height - 1) / 2, "mounting": mounting}


def render(options: argparse.Namespace, seed: int) -> None:
    """One street in OUT/SEED; its folder appears when it is complete."""
    rng = np.random.default_rng([seed, 7])
    folder, unfinished = options.out / f"{seed:06d}", options.out / f".{seed:06d}"
    if folder.exists():
        return
    shutil.rmtree(unfinished, ignore_errors=True)
    (unfinished / "street").mkdir(parents=True)
    seconds = options.pairs / RATE_HZ
    command = [options.program, "--seed", str(seed), "--seconds", f"{seconds + 0.01:.2f}", "--rate", str(RATE_HZ),
               "--speed", str(SPEED_MPS), "--threads", "1", "--first-condition", str(rng.choice(CONDITIONS)),
               "--condition", str(rng.choice(CONDITIONS))]
    changes, busy = PLAIN_CHANGES, options.busy
    if not options.plain:
        (unfinished / "camera.yaml").write_text(yaml.safe_dump(camera(rng), sort_keys=False))
        command += ["--camera", str(unfinished / "camera.yaml")]
        changes = float(rng.choice([0.25, 0.5]))
        busy = busy or rng.random() < MANY_HAZARDS_SHARE
    if busy:
        world = busy_street(rng, seconds * SPEED_MPS * 1.3 + 120, HAZARDS)
        (unfinished / "world.yaml").write_text(yaml.safe_dump(world, sort_keys=False))
        command += ["--world", str(unfinished / "world.yaml")]
    for name, share in (("some", changes), ("none", 0.0), ("all", 1.0)):
        subprocess.run(
            command + ["--changes", str(share), "--change", str(unfinished / "street" / name)],
            check=True, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
        )
    (unfinished / "street").rename(folder)
    shutil.rmtree(unfinished)


def main(arguments: Optional[List[str]] = None) -> int:
    """Exit status: 0 rendered, 2 the command line is wrong or the simulator failed."""
    parser = argparse.ArgumentParser(description="Render streets that are driven twice.")
    parser.add_argument("--out", type=Path, default=Path("build/training/change"), help="folder for one folder a street")
    parser.add_argument("--program", default="install/lib/livemap/livemap_simulate", help="the simulator")
    parser.add_argument("--first-seed", type=int, default=30001)
    parser.add_argument("--worlds", type=int, default=60, help="streets")
    parser.add_argument("--pairs", type=int, default=10, help="of each street")
    parser.add_argument("--plain", action="store_true", help="the simulator's own camera and town, for measuring")
    parser.add_argument("--busy", action="store_true", help="many hazards in every street")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="streets at once")
    options = parser.parse_args(arguments)
    seeds = range(options.first_seed, options.first_seed + options.worlds)
    try:
        with ThreadPoolExecutor(max(options.jobs, 1)) as pool:
            jobs = [pool.submit(render, options, seed) for seed in seeds]
            for number, job in enumerate(jobs, 1):
                job.result()
                print(f"street {number} of {len(jobs)}", flush=True)
    except (OSError, subprocess.CalledProcessError) as error:
        said = getattr(error, "stderr", None)
        print(f"simulate_change: {said.decode(errors='replace').strip() if said else error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
