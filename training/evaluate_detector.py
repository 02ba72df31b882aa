#!/usr/bin/python3
"""Measure a model on the validation parts of the data, run by OpenCV, or in 8 bits by torch, as in a vehicle.

    training/evaluate_detector.py --manifest models/hazards-base.yaml --data ../shared/data --sets training/real_hazards.yaml
"""

import argparse
import sys
import time
from pathlib import Path
from typing import List, Optional, Tuple

import cv2
import numpy as np
import torch

sys.path.insert(0, str(Path(__file__).parent))
from common.figures import NothingMeasured, mean, text
from detector import data, sets
from detector.int8_model import forward_of
from detector.manifest import Manifest, ManifestError, read_manifest
from detector.mistakes import find_mistakes, write_mistakes
from detector.metrics import drive_figures, f1_score
from detector.validation import DetectorRunner, ForwardFunction, HeldOut, Validation, validate, validate_held_out


def milliseconds_per_frame(run: ForwardFunction, manifest: Manifest, repeats: int = 30) -> Tuple[float, float]:
    """Median and shortest time of the network alone; they differ where the machine is busy."""
    image = np.zeros((3, manifest.view.height, manifest.view.width), np.float32)
    times = []
    for _ in range(repeats):
        began = time.perf_counter()
        run(image)
        times.append(time.perf_counter() - began)
    return 1000 * float(np.median(times)), 1000 * min(times)


def print_figures(found: Validation, manifest: Manifest) -> None:
    """All figures, one per line."""
    frames = [frame for drive in found.potholes.values() for frame in drive]
    pothole_limit, cone_limit = manifest.thresholds["pothole"], manifest.thresholds["traffic_cone"]
    figures = drive_figures(found.potholes, pothole_limit)
    print(f"pothole_frames: {len(frames)}")
    print(f"pothole_labels: {sum(len(frame.labels) for frame in frames)}")
    print(f"pothole_ap50: {text(found.pothole_ap(0.5))}")
    print(f"pothole_ap30: {text(found.pothole_ap(0.3))}")
    print(f"pothole_threshold: {pothole_limit}")
    print(f"events: {figures.event_count}")
    print(f"event_recall_iou50: {text(figures.event_recall)}")
    print(f"event_recall_iou30: {text(figures.event_recall_iou30)}")
    print(f"driven_km: {text(figures.km)}")
    print(f"false_reports_per_km: {text(figures.false_reports_per_km, 2)}")
    print(f"false_detections_per_km: {text(figures.false_detections_per_km, 2)}")
    print(f"cone_photos: {len(found.cones)}")
    print(f"cone_ap50: {text(found.cone_ap(0.5))}")
    print(f"cone_threshold: {cone_limit}")
    print(f"cone_f1: {text(f1_score(found.cones, cone_limit, 0.5))}")
    on_drives = drive_figures(found.others_on_drives.get(data.TRAFFIC_CONE, {}), cone_limit).false_reports_per_km
    print(f"cone_reports_per_km_on_survey_drives: {text(on_drives, 2)}")


def print_held_out(found: HeldOut) -> None:
    """AP50 of each class over the held-out parts of the sets, and of each set."""
    for name, figure in found.pooled.items():
        print(f"held_out_{name}_ap50: {text(figure.ap50)} ({figure.labels} labels, {figure.pictures} pictures)")
        for part, of_part in found.by_set[name].items():
            print(f"  {part}: {text(of_part.ap50)} ({of_part.labels} labels, {of_part.pictures} pictures)")
    print(f"held_out_mean_ap50: {text(mean(figure.ap50 for figure in found.pooled.values()))} ({len(found.pooled)} classes)")


def main(arguments: Optional[List[str]] = None) -> int:
    """Exit status: 0 measured, 1 there was nothing to measure, 2 the command line, the model or the data is wrong."""
    parser = argparse.ArgumentParser(description="Measure a model on the validation parts of the data.")
    parser.add_argument("--manifest", type=Path, default=Path("models/hazards-base.yaml"))
    parser.add_argument("--data", type=Path, default=Path("../shared/data"), help="folder of the data sets")
    parser.add_argument("--sets", type=Path, metavar="FILE", help="sets of labelled photos below --data: their held-out parts are measured too")
    parser.add_argument("--mistakes", type=Path, metavar="DIR", help="write sheets of each class's worst misses and false detections in the sets' held-out parts, and a list of all, into this new folder")
    parser.add_argument("--threads", type=int, default=2, help="threads of OpenCV or torch")
    parser.add_argument("--precision", choices=("fp32", "int8"), help="another than the manifest's")
    options = parser.parse_args(arguments)
    if options.mistakes and not options.sets:
        parser.error("--mistakes wants --sets")
    cv2.setNumThreads(options.threads)
    torch.set_num_threads(max(options.threads, 1))
    try:
        manifest = read_manifest(options.manifest)
        drives, cones = data.read_validation_drives(options.data), data.read_validation_cones(options.data)
        run = forward_of(manifest, options.precision)
        runner = DetectorRunner(run, manifest.view)
        if options.sets:
            parts = sets.read_pictures(sets.read_catalogue(options.sets), options.data).held_out
            held_out = validate_held_out(runner, parts, manifest.classes)
            print_held_out(held_out)
            if options.mistakes:
                write_mistakes(find_mistakes(runner, parts, manifest.classes, manifest.thresholds), options.mistakes)
        found = validate(runner, drives, cones)
        print_figures(found, manifest)
        if found.pothole_ap(0.5) is None and found.cone_ap(0.5) is None and not (options.sets and held_out.pooled):
            raise NothingMeasured("no picture has a label.")
        median, shortest = milliseconds_per_frame(run, manifest)
        print(f"milliseconds_per_frame: {median:.0f} median, {shortest:.0f} shortest, {options.threads} threads")
    except NothingMeasured as error:
        print(f"evaluate_detector: nothing was measured: {error}", file=sys.stderr)
        return 1
    except (ManifestError, data.DataError) as error:
        print(f"evaluate_detector: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
