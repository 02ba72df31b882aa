"""What the recordings of `livemap bench perception` say: latencies per stage, event recall, rates."""

import bisect
import csv
import json
import pathlib
import statistics
import subprocess
import tempfile

import rosbag

import demo_system as system
from process_end import how_it_ended
from system_error import StartError
from true_hazards import read_true_hazards

IMAGE_TOPICS = ("camera/image_raw/compressed", "camera/image_raw")
LABELLED_CLASS = "pothole"


def read_stamps(bag):
    """Stamps (ns) of a drive's images, in order."""
    with rosbag.Bag(str(bag)) as messages:
        return [message.header.stamp.to_nsec() for topic, message, _ in messages.read_messages()
                if topic.lstrip("/") in IMAGE_TOPICS]


def read_frames(drive):
    """Names of a survey drive's frames, in order."""
    with open(pathlib.Path(drive) / "frames.csv", newline="", encoding="utf-8-sig") as file:
        return [row["frame"] for row in csv.DictReader(file)]


def first_of_each(entries):
    """Reports by their id, the first time each was heard: it may be sent again."""
    found = {}
    for entry in entries:
        found.setdefault(entry["uuid"], entry)
    return list(found.values())


def of_kind(record, kind, topic=None):
    return [entry for entry in record if entry["kind"] == kind and (topic is None or entry["topic"].endswith(topic))]


def reports_of(run, profile):
    """A small vehicle's reports are made in the zone."""
    return first_of_each(of_kind(run["zone" if profile == "small" else "vehicle"], "report", "hazard/report"))


def found_events(run, profile, stamps, folder):
    """How many of the drive's events have a report that hits one of their labels, and false reports, as
    `livemap evaluate detection` counts them: a report is the only detection of its frame."""
    names = dict(zip(stamps, read_frames(folder)))
    reports = [report for report in reports_of(run, profile) if report["class"] == LABELLED_CLASS]
    with tempfile.TemporaryDirectory() as scratch:
        table = pathlib.Path(scratch) / "reports.csv"
        table.write_text("image,class,score,x_min,y_min,x_max,y_max\n" + "".join(
            f"{names[report['stamp']]},{report['class']},1,{','.join(map(str, report['box']))}\n"
            for report in reports if report["stamp"] in names), encoding="utf-8")
        done = subprocess.run([system.program("livemap_evaluate_detection"), "--json", "--detections", str(table), str(folder)],
                              stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    if done.returncode != 0:
        raise StartError(f"livemap_evaluate_detection {how_it_ended(done.returncode)}: {done.stderr.strip()}")
    told = json.loads(done.stdout)["classes"][LABELLED_CLASS]
    elsewhere = sum(report["stamp"] not in names for report in reports)
    return {"events": told["events"], "found": round((told["event_recall"] or 0) * told["events"]),
            "false": told["false_detections"] + elsewhere, "km": told["km"]}


class ReplayClock:
    """Wall time at which a replay's clock showed a stamp."""

    def __init__(self, record):
        clocks = [entry for entry in record if entry["kind"] == "clock"]
        self.stamps = [entry["stamp"] for entry in clocks]
        self.walls = [entry["wall"] for entry in clocks]

    def wall(self, stamp):
        if len(self.stamps) < 2:
            return None
        i = min(max(bisect.bisect(self.stamps, stamp), 1), len(self.stamps) - 1)
        span = self.stamps[i] - self.stamps[i - 1]
        share = (stamp - self.stamps[i - 1]) / span if span else 0.0
        return self.walls[i - 1] + share * (self.walls[i] - self.walls[i - 1])


def spread(values):
    """Mean, standard deviation and number; None where there is nothing."""
    values = [value for value in values if value is not None]
    if not values:
        return None
    return {"mean": statistics.fmean(values), "sigma": statistics.pstdev(values), "n": len(values)}


def stages_of(run, profile):
    """Lists of milliseconds by stage, of one run."""
    vehicle, zone = run["vehicle"], run["zone"]
    clock = ReplayClock(vehicle)
    # The zone's detector serves several vehicles and has topics of its own.
    detections = (of_kind(zone, "detections", "candidate/detections") if profile == "small"
                  else of_kind(vehicle, "detections", "hazard/detections"))
    detected = {entry["stamp"]: entry["wall"] for entry in reversed(detections)}
    sent = {entry["uuid"]: entry for entry in first_of_each(of_kind(vehicle, "report", "hazard/report"))}
    answered = {entry["uuid"]: entry for entry in first_of_each(of_kind(vehicle, "receipt"))}
    stages = {"detection": [entry["ms"] for entry in detections]}

    def since(entry, start):
        return None if start is None else 1e3 * (entry["wall"] - start)

    if profile == "small":
        # The same frame is a candidate on the vehicle, then detections and reports in the zone.
        candidates = {entry["stamp"]: entry["wall"] for entry in reversed(of_kind(vehicle, "candidate"))}
        made = reports_of(run, profile)
        stages["discard"] = [1e3 * (wall - clock.wall(stamp)) for stamp, wall in candidates.items()
                             if clock.wall(stamp) is not None]
        stages["judging"] = [entry["ms"] for entry in of_kind(vehicle, "judging")]
        stages["to_zone"] = [since(entry, candidates.get(entry["stamp"])) for entry in made]
        stages["end_to_end"] = [since(entry, clock.wall(entry["stamp"])) for entry in made]
        return stages
    both = [(sent[uuid], answered[uuid]) for uuid in sent if uuid in answered]
    stages["placing"] = [since(report, detected.get(report["stamp"])) for report in sent.values()]
    stages["round_trip"] = [since(receipt, report["wall"]) for report, receipt in both]
    stages["end_to_end"] = [since(receipt, clock.wall(report["stamp"])) for report, receipt in both]
    return stages


def together(lists):
    """Stages of several runs as one."""
    merged = {}
    for stages in lists:
        for name, values in stages.items():
            merged.setdefault(name, []).extend(values)
    return {name: spread(values) for name, values in merged.items()}


def picture_bytes(runs):
    """Sizes of the pictures in reports that have one."""
    return [entry["picture"] for run in runs for entry in first_of_each(of_kind(run["vehicle"], "report", "hazard/report"))
            if entry["picture"]]


def boil_down(run, figures):
    """What the page needs of a run; its recording has megabytes."""
    import demo_observers

    drive, counts, profile = run["drive"], figures["counts"], run["profile"]
    small = "small" if profile == "small" else "big"
    told = {"name": drive["name"], "profile": profile, "radius": run["radius"], "link": bool(run["link"]),
            "complete": figures["complete"], "load": figures["load"], "drive_s": figures["drive_s"],
            "frames": figures["frames"], "processed": counts["frames_processed"], "dropped": counts["frames_dropped"],
            "uplink_bytes": counts["uplink_bytes"], "wire_bytes": figures["wire_bytes"],
            "reports": len(reports_of(figures, small)), "on_map": len(figures["stored"]),
            "stages": stages_of(figures, small), "pictures": picture_bytes([figures]), "map_ms": figures["map_ms"]}
    if profile == "small":
        told["processed"] = counts["frames_judged"]
    if drive["folder"]:
        told["found"] = found_events(figures, small, read_stamps(drive["bag"]), drive["folder"])
    else:
        truth = demo_observers.compare_with_truth(figures["stored"], read_true_hazards(drive["truth"]))
        told["found"] = {"events": truth["hazards"], "found": truth["found"], "false": truth["false"], "km": None}
    return told
