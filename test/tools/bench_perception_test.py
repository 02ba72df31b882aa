#!/usr/bin/python3
"""What `livemap bench perception` counts, its link, its page and its mistakes; the drives themselves take minutes.

    bench_perception_test.py SCRIPT
"""

import argparse
import importlib.machinery
import importlib.util
import json
import pathlib
import signal
import socket
import statistics
import subprocess
import sys
import tempfile
import threading
import time
import unittest

import cv2
import numpy

SCRIPT = pathlib.Path(sys.argv.pop()).resolve()
sys.path.insert(0, str(SCRIPT.parent / "lib"))
from listening_port import free_port  # noqa: E402
import perception_figures as figures  # noqa: E402
import perception_page  # noqa: E402

WIDTH, HEIGHT = 400, 300
RIGHT, WRONG = [100, 100, 138, 120], [300, 100, 340, 120]


def report(uuid, stamp, box, wall=0.0, name="pothole", picture=0):
    return {"wall": wall, "kind": "report", "topic": "/hazard/report", "uuid": uuid, "stamp": stamp, "class": name,
            "box": box, "picture": picture}


class FiguresTest(unittest.TestCase):
    # Frames every 5 m; a pothole at 100, 100 to 140, 120 in the first two, and 20 m later in one more.
    stamps = [10, 20, 30, 40, 50, 60, 70]
    with_pothole = {10, 20, 60}

    @classmethod
    def setUpClass(cls):
        cls.folder = pathlib.Path(cls.enterClassContext(tempfile.TemporaryDirectory()))
        for part in ("images", "labels"):
            (cls.folder / part).mkdir()
        rows = ["frame,chainage_m,potholes"]
        for place, stamp in enumerate(cls.stamps):
            rows.append(f"{stamp:06},{5 * place},{int(stamp in cls.with_pothole)}")
            cv2.imwrite(str(cls.folder / "images" / f"{stamp:06}.png"), numpy.zeros((HEIGHT, WIDTH, 3), numpy.uint8))
            label = f"0 {120 / WIDTH} {110 / HEIGHT} {40 / WIDTH} {20 / HEIGHT}\n" if stamp in cls.with_pothole else ""
            (cls.folder / "labels" / f"{stamp:06}.txt").write_text(label)
        (cls.folder / "frames.csv").write_text("\n".join(rows) + "\n")

    def found(self, *reports):
        return figures.found_events({"vehicle": list(reports), "zone": []}, "big", self.stamps, self.folder)

    def test_nothing_reported_finds_no_event_of_the_road_driven(self):
        told = self.found()
        self.assertEqual((told["events"], told["found"], told["false"]), (2, 0, 0))
        self.assertAlmostEqual(told["km"], 0.03)

    def test_an_event_is_found_by_a_report_whose_box_hits_a_label_of_its_own_frame(self):
        self.assertEqual(self.found(report("a", 20, RIGHT), report("a", 20, RIGHT))["found"], 1)
        told = self.found(report("a", 20, WRONG), report("b", 30, RIGHT), report("c", 60, RIGHT),
                          report("d", 70, WRONG, name="traffic_cone"))
        self.assertEqual({key: told[key] for key in ("events", "found", "false")}, {"events": 2, "found": 1, "false": 2})

    def test_half_an_overlap_is_a_hit_and_less_is_none(self):
        self.assertEqual(self.found(report("a", 60, [100, 100, 140, 110]))["found"], 1)
        self.assertEqual(self.found(report("a", 60, [100, 100, 140, 109]))["found"], 0)

    def test_stages_are_told_from_the_wall_times_of_the_same_frame_and_report(self):
        second = 1_000_000_000
        clock = [{"wall": 100.0 + i, "kind": "clock", "stamp": i * second} for i in range(10)]
        detections = {"wall": 102.05, "kind": "detections", "topic": "/hazard/detections", "stamp": 2 * second, "ms": 40.0,
                      "boxes": []}
        receipt = {"wall": 102.65, "kind": "receipt", "topic": "/hazard/receipt", "uuid": "a", "committed": True}
        run = {"vehicle": clock + [detections, report("a", 2 * second, RIGHT, wall=102.4), receipt,
                                   report("b", 3 * second, RIGHT, wall=103.5)], "zone": []}
        told = figures.together([figures.stages_of(run, "big")])
        for stage, expected in (("detection", 40), ("placing", 350), ("round_trip", 250), ("end_to_end", 650)):
            self.assertAlmostEqual(told[stage]["mean"], expected, places=3)
            self.assertEqual(told[stage]["n"], 1)

    def test_of_a_small_vehicle_it_is_told_how_long_its_classifier_takes(self):
        judging = {"wall": 1.0, "kind": "judging", "topic": "/diagnostics", "ms": 20.0}
        told = figures.together([figures.stages_of({"vehicle": [judging], "zone": []}, "small")])
        self.assertEqual(told["judging"]["mean"], 20.0)

    def test_a_small_vehicles_reports_are_those_of_the_zone(self):
        run = {"vehicle": [report("a", 20, WRONG)], "zone": [report("b", 20, RIGHT)]}
        self.assertEqual([entry["uuid"] for entry in figures.reports_of(run, "small")], ["b"])


class LinkTest(unittest.TestCase):
    def test_the_round_trip_is_as_long_and_as_scattered_as_asked_for_and_bytes_are_counted(self):
        server = socket.create_server(("127.0.0.1", 0))
        threading.Thread(target=self.echo, args=(server,), daemon=True).start()
        port = free_port()
        with tempfile.TemporaryDirectory() as folder:
            counts = pathlib.Path(folder) / "counts.json"
            relay = subprocess.Popen(
                [SCRIPT.parent / "lte_relay.py", "--port", str(port), "--to-port", str(server.getsockname()[1]), "--rtt-ms",
                 "80", "--rtt-sigma-ms", "20", "--counts", counts], stdout=subprocess.PIPE, text=True)
            self.assertEqual(relay.stdout.readline(), "listening\n")
            times = []
            with socket.create_connection(("127.0.0.1", port)) as client:
                for _ in range(60):
                    start = time.monotonic()
                    client.sendall(b"x" * 100)
                    received = 0
                    while received < 100:
                        received += len(client.recv(100))
                    times.append(1e3 * (time.monotonic() - start))
            relay.send_signal(signal.SIGINT)
            self.assertEqual(relay.wait(20), 0)
            relay.stdout.close()
            # A busy machine adds to it, never takes away: the mean's own error is 2.6 ms.
            self.assertGreater(statistics.fmean(times), 68)
            self.assertLess(statistics.median(times), 160)
            self.assertGreater(statistics.pstdev(times), 10)
            self.assertEqual(json.loads(counts.read_text()), {"up_bytes": 6000, "down_bytes": 6000})
        server.close()

    @staticmethod
    def echo(server):
        connection, _ = server.accept()
        with connection:
            while data := connection.recv(4096):
                connection.sendall(data)


class PageTest(unittest.TestCase):
    def run_of(self, profile, radius, link=False):
        stages = {"detection": [40.0, 50.0], "placing": [300.0], "round_trip": [210.0], "end_to_end": [560.0]}
        return {"name": "d", "profile": profile, "radius": radius, "link": link, "complete": True, "load": [1.0, 2.0],
                "drive_s": 30.0, "frames": 100, "processed": 90, "dropped": 10, "uplink_bytes": 30000,
                "wire_bytes": 40000 if link else None, "reports": 5, "on_map": 4, "stages": stages, "pictures": [9000, 11000],
                "map_ms": [], "found": {"events": 10, "found": 7, "false": 1, "km": 0.5}}

    def test_the_page_has_both_tables_the_plots_and_what_is_missing(self):
        engines = [{"name": f"BM_Pool/torch:{kind}/engines:1/threads:1/real_time", "label": label, "items_per_second": rate,
                    "pool_mib": 50.0} for kind, label, rate in ((0, "opencv", 4.0), (1, "torch", 10.0))]
        results = {"quick": True, "simulated": False, "usual_radius_m": 5, "drives": ["d"], "date": "2026-01-01",
                   "version": "v", "model": "hazards-most", "machine": {"cpu": "c", "cores": 2}, "detector": None, "engines": engines,
                   "link": {"rtt_ms": 205.6, "rtt_sigma_ms": 50.2, "up_mbit_s": 10.0, "down_mbit_s": 30.0},
                   "saturated": [{"model": "hazards-small", "camera_hz": 30, "frames": 200, "processed": 140, "dropped": 60, "in_one_view": 120,
                                  "processed_hz": 21.0, "committed": 9, "load": [1.0, 2.0]}],
                   "streams": [{"frames": 100, "seconds": 30.0, "bytes": 3000000}],
                   "runs": [self.run_of("big", 1), self.run_of("big", 5), self.run_of("big", 5, link=True),
                            self.run_of("perfect", 5)],
                   "pools": {"hazards-small": engines}, "versions": {"d_perfect_5m_loopback": "earlier", "engines": "v"}}
        with tempfile.TemporaryDirectory() as folder:
            text = perception_page.write(results, pathlib.Path(folder)).read_text(encoding="utf-8")
            lines = " ".join(text.split())  # However the prose is wrapped.
            for name in ("perception_uplink.png", "perception_latency.png"):
                self.assertTrue((pathlib.Path(folder) / name).read_bytes().startswith(b"\x89PNG"))
        for part in ("| BVC, link | - | 45.0 (5.0), n = 2 | 300.0 (0.0), n = 1 | 210.0 (0.0), n = 1 | 560.0 (0.0), n = 1 |",
                     "| BVC | 3.0 | 10 of 100 | - | 0.700 (7 of 10) | 2.0 | 0.008 | 5 |",
                     "| BVC, 1 m | 0.700 (7 of 10) | 5 | 4 | 0.0080 |", "| perfect detector, 5 m | 0.700 (7 of 10) | 5 | 4 | 0.0213 |",
                     "| H.264 stream, 3.3 frames/s | - | - | - | 0.8000 |", "| torch | 1 | 1 | 10.0 | 2.50 | 50 |",
                     "the SVC's rows are missing", "**The quick form**", "| hazards-small | 4.0 | 10.0 | 21.0 | 60 of 200 | 120 | 9 |",
                     "The detector, on board and in the zone, is hazards-most,",
                     "Measured with version earlier: d_perfect_5m_loopback."):
            self.assertIn(part, lines)


class ResumeTest(unittest.TestCase):
    def test_figures_of_another_model_or_link_are_refused_and_those_of_the_same_taken_up(self):
        loader = importlib.machinery.SourceFileLoader("bench", str(SCRIPT))
        bench = importlib.util.module_from_spec(importlib.util.spec_from_loader("bench", loader))
        loader.exec_module(bench)
        with tempfile.TemporaryDirectory() as folder:
            options = argparse.Namespace(cache=pathlib.Path(folder), quick=True, resume=True, root=".")
            bench.Kept(options, {"model": "one"}).figures("run", lambda: [1])
            self.assertEqual(bench.Kept(options, {"model": "one"}).figures("run", lambda: [2]), [1])
            with self.assertRaisesRegex(bench.BenchError, "run.json' was measured with another --model or link"):
                bench.Kept(options, {"model": "another"}).figures("run", lambda: [2])


class MistakesTest(unittest.TestCase):
    def test_each_mistake_is_one_sentence_and_exit_status_2(self):
        for arguments, sentence in ((["--drive", "/nowhere"], "--drive is '/nowhere', which has no frames.csv"),
                                    (["--rtt-ms", "-1"], "--rtt-ms is -1, accepted is 0 to 10000"),
                                    (["--model", "/nowhere"], "--model is '/nowhere', which is no file"),
                                    (["--again", "/nowhere"], "--again is '/nowhere', which is no file"),
                                    (["--qick"], "unrecognized arguments: --qick")):
            done = subprocess.run([SCRIPT, *arguments], capture_output=True, text=True)
            self.assertEqual(done.returncode, 2, done.stderr)
            self.assertEqual(len(done.stderr.strip().splitlines()), 1, done.stderr)
            self.assertIn(sentence, done.stderr)


if __name__ == "__main__":
    unittest.main()
