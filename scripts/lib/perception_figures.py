"""What the recordings of `livemap bench perception` say: latencies per stage, event recall, rates."""

import bisect
import csv
import pathlib
import statistics

import rosbag

# As src/evaluation has them: two labelled frames further apart belong to two events; a hit overlaps by so much.
EVENT_GAP_M = 12.0
HIT_IOU = 0.5
IMAGE_TOPICS = ("camera/image_raw/compressed", "camera/image_raw")
TRUTH_TOPIC = "ground_truth/boxes"


def iou(a, b):
    """Intersection over union of two boxes x_min, y_min, x_max, y_max."""
    width = min(a[2], b[2]) - max(a[0], b[0])
    height = min(a[3], b[3]) - max(a[1], b[1])
    if width <= 0 or height <= 0:
        return 0.0
    both = width * height
    return both / ((a[2] - a[0]) * (a[3] - a[1]) + (b[2] - b[0]) * (b[3] - b[1]) - both)


def read_truth(bag):
    """Stamps (ns) of a drive's images in order, and by stamp the true boxes [class, x_min, y_min, x_max, y_max]."""
    stamps, boxes = [], {}
    with rosbag.Bag(str(bag)) as messages:
        for topic, message, _ in messages.read_messages():
            topic = topic.lstrip("/")
            if topic in IMAGE_TOPICS:
                stamps.append(message.header.stamp.to_nsec())
            elif topic == TRUTH_TOPIC:
                boxes[message.header.stamp.to_nsec()] = [
                    [d.class_name, d.x_min, d.y_min, d.x_max, d.y_max] for d in message.detections]
    return stamps, boxes


def read_chainage(drive):
    """Metres along the road of a survey drive's frames, in order."""
    with open(pathlib.Path(drive) / "frames.csv", newline="", encoding="utf-8") as file:
        return [float(row["chainage_m"]) for row in csv.DictReader(file)]


def events_of(stamps, chainage, boxes, name):
    """The events of one class: lists of the stamps of their frames."""
    events, last = [], None
    for stamp, metres in zip(stamps, chainage):
        if not any(box[0] == name for box in boxes.get(stamp, [])):
            continue
        if last is None or metres - last > EVENT_GAP_M:
            events.append([])
        events[-1].append(stamp)
        last = metres
    return events


def road_km(chainage):
    """As src/evaluation counts it: a gap is at most as long as events are apart."""
    return sum(min(after - before, EVENT_GAP_M) for before, after in zip(chainage, chainage[1:])) / 1000


def is_hit(report, boxes):
    return any(box[0] == report["class"] and iou(report["box"], box[1:]) >= HIT_IOU
               for box in boxes.get(report["stamp"], []))


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


def found_events(run, profile, truth, name):
    """How many events of the class have a report that hits one of their labels, of how many; and false reports."""
    stamps, boxes, chainage = truth
    reports = [report for report in reports_of(run, profile) if report["class"] == name]
    hits = {report["stamp"] for report in reports if is_hit(report, boxes)}
    events = events_of(stamps, chainage, boxes, name)
    return {"events": len(events), "found": sum(any(stamp in hits for stamp in event) for event in events),
            "false": sum(not is_hit(report, boxes) for report in reports), "km": road_km(chainage)}


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
        stamps, boxes = read_truth(drive["bag"])
        told["found"] = found_events(figures, small, (stamps, boxes, read_chainage(drive["folder"])), "pothole")
    else:
        truth = demo_observers.compare_with_truth(figures["stored"], drive["truth"])
        told["found"] = {"events": truth["hazards"], "found": truth["found"], "false": truth["false"], "km": None}
    return told
