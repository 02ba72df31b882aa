"""The page of both vehicle cloudlets' figures: the thesis's tables 3.1 and 3.2 and its figure 3.6, measured here."""

import textwrap

import perception_figures as figures
import perception_plots

# Means and standard deviations of table 3.1, ms; of the BVC per GPU.
THESIS_LATENCY = {"big": ("38.6 (3.1)", "205.6 (50.2)", "244.2 (50.3)"), "small": ("391.6 (67.1)", "205.6 (50.2)", "597.2 (83.7)")}
THESIS_DETECTION = {"big": ("30", "0.527", "0.923", "0.46"), "small": ("2.8", "0.343", "0.846", "0.91")}
NAMES = {"big": "BVC", "small": "SVC + zone", "perfect": "perfect detector"}
MBIT = 8e-6


def prose(text):
    """A paragraph of its own."""
    return "\n" + textwrap.fill(" ".join(text.split()), 100, break_long_words=False, break_on_hyphens=False) + "\n"


def table(head, rows):
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    return "\n".join(lines + ["| " + " | ".join(str(cell) for cell in row) + " |" for row in rows]) + "\n"


def number(value, digits):
    return "-" if value is None else f"{value:.{digits}f}"


def spread(found):
    return "-" if not found else f"{found['mean']:.1f} ({found['sigma']:.1f}), n = {found['n']}"


class Group:
    """The runs of one configuration over all drives."""

    def __init__(self, results, profile, radius=None, link=False):
        self.profile, self.radius = profile, radius or results["usual_radius_m"]
        self.runs = [run for run in results["runs"] if (run["profile"], run["radius"], run["link"])
                     == (profile, self.radius, link)]

    def __bool__(self):
        return bool(self.runs)

    def sum(self, key):
        return sum(run[key] for run in self.runs)

    def stages(self):
        return figures.together(run["stages"] for run in self.runs)

    def found(self, key):
        return sum(run["found"][key] for run in self.runs)

    def recall(self):
        return self.found("found") / self.found("events") if self.found("events") else None

    def false_per_km(self):
        km = [run["found"]["km"] for run in self.runs]
        return None if None in km or not sum(km) else self.found("false") / sum(km)

    def mbit_s(self, extra_bytes=0.0):
        return (self.sum("uplink_bytes") + extra_bytes) * MBIT / self.sum("drive_s")

    def wire_mbit_s(self):
        counted = [run["wire_bytes"] for run in self.runs]
        return None if None in counted else sum(counted) * MBIT / self.sum("drive_s")

    def frames_per_s(self):
        return self.sum("processed") / self.sum("drive_s")


def perfect_mbit_s(results, perfect):
    """True boxes come without pictures; each report gets one of the mean size of the BVC's."""
    pictures = [size for run in results["runs"] if run["profile"] == "big" for size in run["pictures"]]
    return perfect.mbit_s(perfect.sum("reports") * sum(pictures) / max(len(pictures), 1))


def latency_rows(results):
    rows = []
    for profile in ("big", "small"):
        for link in (True, False):
            group = Group(results, profile, link=link)
            if group:
                rows.append({"profile": profile, "name": f"{NAMES[profile]}, {'link' if link else 'loopback'}",
                             "stages": group.stages()})
    return rows


def judging(rows):
    """How much of the early discard its classifier takes."""
    times = [row["stages"]["judging"] for row in rows if row["stages"].get("judging")]
    return f" (the classifier: {max(found['mean'] for found in times):.0f} ms at most, on one thread)" if times else ""


def latency_section(results, out):
    rows = latency_rows(results)
    thesis = [(f"thesis: {NAMES[profile]}", float(detection.split()[0]), float(round_trip.split()[0]))
              for profile, (detection, round_trip, _) in THESIS_LATENCY.items()]
    perception_plots.draw_latency(rows, thesis, out / "perception_latency.png")
    link = results["link"]
    cells = []
    for row in rows:
        found = row["stages"]
        cells.append([row["name"], spread(found.get("discard")), spread(found.get("detection")),
                      spread(found.get("placing")), spread(found.get("round_trip") or found.get("to_zone")),
                      spread(found.get("end_to_end"))])
    for profile, (detection, round_trip, whole) in THESIS_LATENCY.items():
        cells.append([f"thesis: {NAMES[profile]}", "-" if profile == "big" else "in the next", detection, "-", round_trip, whole])
    text = "## Table 3.1: latency\n" + prose(f"""
        Milliseconds, mean (standard deviation). *Link*: a relay between vehicle and broker that delays each way so
        that the round trip is {link['rtt_ms']:g} +- {link['rtt_sigma_ms']:g} ms, as the thesis measured over LTE, and
        lets {link['up_mbit_s']:g} Mbit/s up and {link['down_mbit_s']:g} down through, in order, as TCP has it.
        *Loopback*: without it. *Early discard*: from the image's stamp to the candidate frame that leaves the
        vehicle: judging{judging(rows)}, the wait for the next fix, masking, encoding. *Detection*: from the decoded
        image to the boxes, per frame; of the SVC, in the zone. *Placing*: from the boxes to the report: the wait for
        the first fix after the image (up to 0.3 s), projection, and the picture. *Round trip*: from the report to the
        zone's receipt of it, which comes after its fsync; of the SVC, from the candidate frame to the zone's report,
        with the zone's detection in it. *End to end*: from the image's stamp to the receipt (SVC: to the report in
        the zone); what its stages do not sum up to is waiting, for the camera's rectified image and for a turn at the
        detector. Stages that every frame goes through are means over all frames, the others over the reports, so that
        the sum may exceed the end to end too. Detection of the thesis had no further stage, so its end to end is the
        sum of two.""")
    text += "\n" + table(["configuration", "early discard", "detection", "placing", "round trip", "end to end"], cells)
    return text + "\n![Latency per stage](perception_latency.png)\n"


def detection_section(results):
    detector = (results["detector"] or {}).get("classes", {}).get("pothole")
    cells = []
    for profile in ("big", "small"):
        group = Group(results, profile)
        if group:
            cells.append([NAMES[profile], number(group.frames_per_s(), 1), f"{group.sum('dropped')} of {group.sum('frames')}",
                          number(detector["ap50"], 3) if detector else "-", f"{number(group.recall(), 3)} "
                          f"({group.found('found')} of {group.found('events')})", number(group.false_per_km(), 1),
                          number(group.mbit_s(), 3), group.sum("reports")])
    for profile, (rate, ap50, recall, mbit_s) in THESIS_DETECTION.items():
        cells.append([f"thesis: {NAMES[profile]}", rate, "-", ap50, recall, "-", mbit_s, "-"])
    frames = sum(run["frames"] for run in Group(results, "big").runs)
    seconds = sum(run["drive_s"] for run in Group(results, "big").runs)
    text = "## Table 3.2: detection\n" + prose(f"""
        Frames/s is what was processed (of the SVC: judged by its classifier) of what the drives hold: {frames} frames
        in {seconds:.0f} s, so {frames / max(seconds, 1e-9):.1f} is the most there (the thesis's camera gave 30; what
        the engines could do stands below). The SVC's classifier looks at five frames a second at most and leaves others out
        on purpose; *dropped* counts the frames that came too fast. Radius of duplicates {results['usual_radius_m']}
        m. A false report is each whose box overlaps no label of its frame by IoU 0.5; `livemap evaluate
        detection` counts those within 12 m as one, so its figure is another. Mbit/s is the uplink as the bridge
        counts it, of reports, pictures, positions and everything else.""")
    if detector:
        text += prose(f"""AP50 is the detector's own over all labelled frames of the drives (n = {detector['n']}
            frames, {detector['labels']} potholes), by `livemap evaluate detection`; there, frame by frame and without
            places, its event recall is {number(detector['event_recall'], 3)} of {detector['events']} events at
            {number(detector.get('false_per_km'), 1)} false reports per km. Event recall in the table is harder: an
            event counts when a *report* reached the zone whose box overlaps a label of its own frame by IoU
            0.5. Hazards that are too far away or badly placed to report, or suppressed as duplicates,
            are missed.""")
    else:
        text += prose("""The drive is simulated: recall is the share of true hazards that are on the zone's map within 5 m
            afterwards, all classes.""")
    return text + "\n" + table(["configuration", "frames/s", "dropped", "AP50", "event recall", "false reports/km", "Mbit/s",
                                "reports"], cells)


def uplink_section(results, out):
    radii = sorted({run["radius"] for run in results["runs"] if run["profile"] == "big"})
    points, cells = [], []

    def add(name, label, kind, group, mbit_s):
        if group.recall() is not None:  # Without events there is no place in the plot, not even 0.
            points.append({"label": label, "kind": kind, "recall": group.recall(), "mbit_s": mbit_s,
                           "by": "places" if results["simulated"] else "events"})
        cells.append([name, f"{number(group.recall(), 3)} ({group.found('found')} of {group.found('events')})",
                      group.sum("reports"), group.sum("on_map"), number(mbit_s, 4)])

    for radius in radii:
        group = Group(results, "big", radius)
        if group:
            add(f"BVC, {radius} m", f"{radius} m", "big", group, group.mbit_s())
    small, perfect = Group(results, "small"), Group(results, "perfect")
    if small:
        add(NAMES["small"], "", "small", small, small.mbit_s())
    if perfect:
        add("perfect detector, 5 m", "", "perfect", perfect, perfect_mbit_s(results, perfect))
    streams = [stream for stream in results["streams"] if stream]
    stream_mbit_s = None
    if streams:
        seconds, frames = sum(s["seconds"] for s in streams), sum(s["frames"] for s in streams)
        stream_mbit_s = sum(s["bytes"] for s in streams) * MBIT / seconds
        cells.append([f"H.264 stream, {frames / seconds:.1f} frames/s", "-", "-", "-", number(stream_mbit_s, 4)])
    perception_plots.draw_uplink(points, stream_mbit_s, out / "perception_uplink.png")
    text = "## Figure 3.6: uplink against recall\n\n![Uplink against recall](perception_uplink.png)\n\n"
    text += table(["configuration", "event recall", "reports", "hazards on the map", "Mbit/s"], cells)
    text += prose("""The perfect detector's boxes are the labels, reported by the same vehicle; they come without
        pictures, so each of its reports is counted with a picture of the mean size of the BVC's. Its recall is what
        placing and duplicates let through. The stream is the drive's own frames at their own rate by ffmpeg (libx264,
        medium, CRF 23); thesis: nearly 9 Mbit/s at 30 frames/s. A duplicate is a hazard of the same class within the
        radius, at the vehicle and at the zone alike.""")
    wire = Group(results, "big", link=True)
    if wire and wire.wire_mbit_s() is not None:
        text += prose(f"""Over the link, the BVC's TCP payload towards the broker was {wire.wire_mbit_s():.4f} Mbit/s, MQTT and login
            included, where its bridge counted {wire.mbit_s():.4f}.""")
    if not small:
        text += prose("""This build's vehicle has no `profile:=small`: the SVC's rows are missing.""")
    return text


def engines_section(results):
    rows = [row for row in results["engines"] or [] if not row.get("error_occurred")]
    if not rows:
        return ""
    rates = {}
    for row in rows:
        numbers = dict(part.split(":") for part in row["name"].split("/") if ":" in part)
        rates[(row["label"], int(numbers["engines"]), int(numbers["threads"]))] = row
    slowest = rates[min(rates)]["items_per_second"] if ("opencv", 1, 1) not in rates else rates[("opencv", 1, 1)]["items_per_second"]
    cells = [[engine, engines, threads, number(row["items_per_second"], 1), number(row["items_per_second"] / slowest, 2),
              number(row.get("pool_mib"), 0)] for (engine, engines, threads), row in sorted(rates.items())]
    failed = [row["name"] for row in results["engines"] if row.get("error_occurred")]
    text = "## Engines\n" + prose("""This is the rate of a pool of engines that is given 640x400 frames without end,
        with the same model (`livemap_detector_benchmark --benchmark_filter=BM_Pool`): letterbox, network, decoding.
        All in one run of one process, so the ratios to OpenCV with one thread mean more than the rates. MiB: what the
        process grew by, in the order of the runs; later ones reuse what earlier ones left.""")
    text += "\n" + table(["engine", "engines", "threads each", "frames/s", "ratio", "MiB"], cells)
    if failed:
        text += prose(f"Not measured: {', '.join(failed)}.")
    return text


def pool_rate(rows, engine):
    """Frames/s of a pool with as many engines as cores."""
    rates = [row["items_per_second"] for row in rows or [] if row.get("label") == engine and not row.get("error_occurred")]
    return number(rates[0] if rates else None, 1)


def saturated_section(results):
    runs = results.get("saturated")
    if not runs:
        return ""
    pools = results.get("pools", {})
    cells = [[run["model"], pool_rate(pools.get(run["model"]), "opencv"), pool_rate(pools.get(run["model"]), "torch"),
              number(run["processed_hz"], 1), f"{run['dropped']} of {run['frames']}", run.get("in_one_view", "-"), run["committed"]] for run in runs]
    return "## From the camera to the report\n" + prose(f"""
        A simulated street (seed 20201, 20 s) through a camera of 640x400 pixels and {runs[0]['camera_hz']} frames/s,
        as the thesis's camera gave them. The frames that the vehicle processes give the rate of the whole: decoding,
        rectification, detector (the defaults: two engines of one thread, the engine of the model's manifest), placing,
        masking of the reports' pictures, report. What is too much is dropped, oldest first. *In one view*: of the
        processed frames, those that a model of two views looked at once (`all_views_hz`, `one_view_from_waiting`).
        Player, broker and zone take their share of the same cores. *Pool*: the same engines alone, as in the table
        above.""") + "\n" + table(
        ["model", "pool, OpenCV (frames/s)", "pool, libtorch (frames/s)", "camera to report (frames/s)", "dropped",
         "in one view", "reports in the zone's store"], cells)


def starved(results):
    """A warning where frames were dropped: then rates, latencies and recall are the machine's and not the detector's."""
    runs = [run for run in results["runs"] if run["profile"] == "big"]
    dropped, frames = sum(run["dropped"] for run in runs), sum(run["frames"] for run in runs)
    if dropped <= 0.05 * frames:
        return ""
    return prose(f"""**The machine starved in this run.** {dropped} of the {frames} frames that the BVC got over all its runs were
        dropped because the detector was behind, and those that were not waited seconds in its queue. Its event
        recall, its frames/s and its latencies are no figures of the system on a machine of its own, and differences
        between the radii are chance; what holds is that every part ran, the link's round trip, sizes of reports, and
        the ratios between engines.""")


def other_versions(results):
    """What --resume took up from an earlier version, by the names of the runs."""
    others = {}
    for name, version in results.get("versions", {}).items():
        if version != results["version"]:
            others.setdefault(version, []).append(name)
    return "".join(prose(f"Measured with version {version}: {', '.join(sorted(found))}.") for version, found in sorted(others.items()))


def write(results, out):
    out.mkdir(parents=True, exist_ok=True)
    machine = results["machine"]
    loads = [load for run in results["runs"] for load in run["load"]]
    incomplete = [run for run in results["runs"] if not run["complete"]]
    drives = ", ".join(results["drives"])
    text = "# Perception: both vehicle cloudlets as the thesis measured them\n"
    text += prose(f"""Written by `./livemap bench perception{' --quick' if results['quick'] else ''}` on
        {results['date']}, version {results['version'] or 'unknown'}: {machine['cpu']}, {machine['cores']} cores.
        Vehicle, broker, zone, live map, player and recorder all ran on these cores, with a load of {min(loads):.1f}
        to {max(loads):.1f} before and after the runs ({machine['cores']} is full), the system's own among it. Times
        are those of a crowded machine where it is higher, and only their ratios travel. Drives: {drives}
        ({'simulated' if results['simulated'] else 'road survey at 16 m/s, stretches without pictures cut to 1 s'}),
        each configuration driven once per drive. The vehicles are real ones of `launch/vehicle.launch`, played from
        bags by `launch/replay.launch`; GPS fixes are simulated along the road. The detector, on board and in the
        zone, is {results['model']}, two engines of one thread, as those launch files have it. The validation sections
        of the survey (386RS169832, 251BDF0530, 080BDF0070, 290RS070691) chose the weights and thresholds of the
        detectors that ship, so figures on them are somewhat optimistic.""")
    text += prose("""*BVC* is the thesis's big vehicle cloudlet, `vehicle.launch profile:=big`: the detector runs on
        board. *SVC* is its small one, `profile:=small`: a classifier on board sends the frames worth it to the zone,
        whose detector finishes the job. Numbers of tables and figures are those of the thesis's chapter 3. [How to
        measure all this again](../how-to/measure.md#both-vehicle-cloudlets).""")
    if results["quick"]:
        text += prose("""**The quick form**: one drive and three radii. Its figures have few events; the whole run's have more.""")
    text += starved(results) + other_versions(results)
    if incomplete:
        names = sorted({f"{run['name']} {run['profile']} {run['radius']} m" for run in incomplete})
        text += prose(f"""Not everything came through in {len(incomplete)} of {len(results['runs'])} runs within a
            minute of the drive's end: {', '.join(names)}.""")
    text += "\n" + "\n".join(section for section in (latency_section(results, out), detection_section(results),
                                                     uplink_section(results, out), engines_section(results),
                                                     saturated_section(results)) if section)
    page = out / "perception.md"
    page.write_text(text, encoding="utf-8")
    return page
