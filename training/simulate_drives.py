#!/usr/bin/python3
"""Render simulated drives for training or for measuring, each with a street, weather and camera of its own.

    training/simulate_drives.py --out build/training/simulated --first-seed 10001 --drives 110
    training/simulate_drives.py --out build/training/simulated --first-seed 15001 --drives 50 --rare
    training/simulate_drives.py --out build/training/simulated_validation --first-seed 20001 --drives 12

A drive that is there already is left as it is, so that a stopped run continues with the same command.
"""

import argparse
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

COUNTRY_ROAD_SHARE = 0.4
"""Drives on open road with many potholes, through a camera like the road survey's."""

RARE_HAZARDS = ("debris", "debris", "debris", "deer", "stopped_accident", "stopped_accident", "road_work_sign", "construction_machine")
"""What a street that a seed makes up has too few of to learn them; --rare fills streets with them. Debris is hidden or far away
more often than it can be seen, and an accident has to be told from cars that are merely parked: they stand there more often."""

SPEED_MPS = 9.0


def country_road(rng: np.random.Generator, length_m: float) -> Dict[str, Any]:
    """A world file's content: no town, potholes of all sizes, alone and in groups, few other hazards."""
    hazards = []
    at_m = 8.0
    while at_m < length_m:
        for _ in range(rng.choice([1, 1, 1, 2, 3])):
            hazards.append({
                "class": "pothole", "at_m": round(at_m + float(rng.uniform(0, 3)), 2),
                "left_m": round(float(rng.uniform(-3.1, 1.6)), 2),
                "radius_m": round(float(np.exp(rng.uniform(np.log(0.13), np.log(0.8)))), 2),
                "water": bool(rng.random() < 0.25),
            })
        if rng.random() < 0.15:
            hazards.append({"class": str(rng.choice(["traffic_cone", "debris", "deer", "barrier"])), "at_m": round(at_m + 6, 2),
                            "left_m": round(float(rng.uniform(-3.3, 3.0)), 2)})
        at_m += float(rng.uniform(7, 22))
    return {
        "road": {"parking_width_m": 0, "pavement_width_m": round(max(1.0, float(rng.uniform(0.6, 2.0))), 2), "crossings_m": [],
                 "lane_width_m": round(float(rng.uniform(3.2, 3.7)), 2)},
        "scene": {"buildings": False, "parked_cars": False, "trees": bool(rng.random() < 0.8)},
        "hazards": sorted(hazards, key=lambda hazard: hazard["at_m"]),
    }


def camera(rng: np.random.Generator, survey: bool) -> Dict[str, Any]:
    """A camera file's content: like the road survey's, or one behind a windscreen."""
    if survey:
        width, height, focal = 640, 400, float(rng.uniform(700, 1000))
        mounting = {"height_m": float(rng.uniform(1.9, 2.6)), "pitch_deg": float(rng.uniform(10, 18))}
    else:
        width, height, focal = 640, int(rng.choice([400, 480])), float(rng.uniform(440, 650))
        mounting = {"height_m": float(rng.uniform(1.25, 1.9)), "pitch_deg": float(rng.uniform(2, 10))}
    mounting = {"forward_m": 0.0, "left_m": 0.0, "roll_deg": float(rng.uniform(-0.7, 0.7)), "yaw_deg": float(rng.uniform(-3, 3)), **mounting}
    return {"name": "simulated", "width": width, "height": height, "fx": focal, "fy": focal,
            "cx": (width - 1) / 2, "cy": (height - 1) / 2, "mounting": mounting}


def world(rng: np.random.Generator, survey: bool, rare: bool, length_m: float) -> Optional[Dict[str, Any]]:
    """A world file's content; none where the simulator makes the street up."""
    if rare:
        return busy_street(rng, length_m, RARE_HAZARDS)
    return country_road(rng, length_m) if survey else None


def render(options: argparse.Namespace, seed: int) -> None:
    """One drive in OUT/SEED; its folder appears when it is complete."""
    rng = np.random.default_rng(seed)
    survey = rng.random() < COUNTRY_ROAD_SHARE and not options.rare
    folder, unfinished = options.out / f"{seed:06d}", options.out / f".{seed:06d}"
    if folder.exists():
        return
    shutil.rmtree(unfinished, ignore_errors=True)
    unfinished.mkdir(parents=True)
    camera_file, world_file = unfinished / "camera.yaml", unfinished / "world.yaml"
    camera_file.write_text(yaml.safe_dump(camera(rng, survey), sort_keys=False))
    seconds = options.frames / options.rate
    command = [options.program, "--seed", str(seed), "--condition", str(rng.choice(CONDITIONS)), "--camera", str(camera_file),
               "--seconds", str(seconds), "--rate", str(options.rate), "--speed", str(SPEED_MPS), "--threads", "1",
               "--blur", str(rng.choice([0, 0, 3])), "--yolo", str(unfinished / "drive")]
    street = world(rng, survey, options.rare, seconds * SPEED_MPS * 1.1 + 200)
    if street:
        world_file.write_text(yaml.safe_dump(street, sort_keys=False))
        command += ["--world", str(world_file)]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    camera_file.rename(unfinished / "drive" / camera_file.name)
    (unfinished / "drive").rename(folder)
    shutil.rmtree(unfinished)


def main(arguments: Optional[List[str]] = None) -> int:
    """Exit status: 0 rendered, 2 the command line is wrong or the simulator failed."""
    parser = argparse.ArgumentParser(description="Render simulated drives for training.")
    parser.add_argument("--out", type=Path, default=Path("build/training/simulated"), help="folder for one folder a drive")
    parser.add_argument("--program", default="install/lib/livemap/livemap_simulate", help="the simulator")
    parser.add_argument("--first-seed", type=int, default=10001)
    parser.add_argument("--drives", type=int, default=110)
    parser.add_argument("--frames", type=int, default=20, help="pictures of each drive")
    parser.add_argument("--rate", type=float, default=0.8, help="pictures per second")
    parser.add_argument("--rare", action="store_true", help="town streets full of hazards that are rare elsewhere")
    parser.add_argument("--jobs", type=int, default=2, help="drives at once")
    options = parser.parse_args(arguments)
    seeds = range(options.first_seed, options.first_seed + options.drives)
    try:
        with ThreadPoolExecutor(options.jobs) as pool:
            jobs = [pool.submit(render, options, seed) for seed in seeds]
            for number, job in enumerate(jobs, 1):
                job.result()
                print(f"drive {number} of {len(jobs)}", flush=True)
    except (OSError, subprocess.CalledProcessError) as error:
        said = getattr(error, "stderr", None)
        print(f"simulate_drives: {said.decode(errors='replace').strip() if said else error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
