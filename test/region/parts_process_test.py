#!/usr/bin/python3
"""One zone of two processes: officials of the region decide about the hazards of both, also while one of them is killed.

  parts_process_test.py --server PATH_OF_map_page_server --region PATH_OF_livemap_serve_region --user PATH_OF_livemap_zone_user
"""

import argparse
import socket
import sys
import threading
import unittest

from region_fixture import eventually, temporary_folder
from map_page_fixture import OPTIONS
from parts_fixture import Client, Metropolis

HOSTILE_NAMES = ("a\tb", "\u202eecila", "\u200b", "x" * 65, "alice\u2028root")


class Mute:
    """Takes requests and hangs up without an answer."""

    def __init__(self):
        self.posts = 0
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.port = self.listener.getsockname()[1]
        threading.Thread(target=self.serve, daemon=True).start()

    def serve(self):
        while True:
            try:
                guest, _ = self.listener.accept()
            except OSError:
                return
            with guest:
                if guest.recv(1 << 16).startswith(b"POST"):
                    self.posts += 1


class PartsTest(unittest.TestCase):
    def setUp(self):
        self.metro = Metropolis(temporary_folder(self), OPTIONS.region, OPTIONS.user)
        self.addCleanup(self.metro.close)

    def start(self, **options):
        self.metro.start(**options)
        self.stranger = Client(self.metro.region.url)
        self.alice = Client(self.metro.region.url).log_in("alice")

    def candidates(self, count):
        """By part, as soon as there are so many; of each part the newest."""
        eventually(lambda: len(self.alice.hazards("?state=candidate")) == count, f"not {count} candidates")
        found = {}
        for one in self.alice.hazards("?state=candidate").values():
            longitude, latitude = one["geometry"]["coordinates"]
            name = min(self.metro.places, key=lambda part: abs(self.metro.places[part][0] - latitude)
                       + abs(self.metro.places[part][1] - longitude))
            found[name] = one["id"]
        return found

    def trail(self):
        """What was decided, by whom, about what: the oldest first."""
        told = self.alice.get("/api/v1/decisions")[1]
        return [(one["zone"], one["decision"], one["official"], one["subject"]) for one in reversed(told["decisions"])], told

    def decisions_of(self, name):
        return Client(self.metro.parts[name].url).get("/api/v1/decisions")[1]["decisions"]

    def test_an_official_confirms_a_hazard_of_one_part_and_rejects_one_of_the_other_and_takes_it_back(self):
        self.start()
        self.metro.report("metro-1")
        self.metro.report("metro-2")
        found = self.candidates(2)
        self.assertEqual(self.stranger.hazards(), {})
        status, told = self.alice.decide(found["metro-1"], "confirm")
        self.assertEqual((status, told["id"], told["properties"]["state"]), (200, found["metro-1"], "active"))
        status, told = self.alice.decide(found["metro-2"], "reject", {"reason": "a shadow"})
        self.assertEqual(status, 200, told)
        status, undone = self.alice.decide(found["metro-2"], "undo", {"decision_id": told["properties"]["decision_id"]})
        self.assertEqual((status, undone["properties"]["state"]), (200, "candidate"))
        lines, told = self.trail()
        official = "alice at metro"
        self.assertCountEqual(lines, [("metro-1", "confirm", official, found["metro-1"]),
                                      ("metro-2", "reject", official, found["metro-2"]),
                                      ("metro-2", "undo", official, found["metro-2"])])
        self.assertEqual(told["missing"], [])
        eventually(lambda: set(self.stranger.hazards()) == {found["metro-1"]}, "the confirmed one is not shown to all")
        # In the part itself, too.
        self.assertEqual([one["official"] for one in self.decisions_of("metro-1")], [official])
        status, sightings = self.alice.get(f"/api/v1/hazards/{found['metro-1']}/sightings")
        self.assertEqual((status, len(sightings["sightings"])), (200, 1))
        status, picture = self.alice.get(sightings["sightings"][0]["image"])
        self.assertEqual((status, picture[:3]), (200, b"\xff\xd8\xff"))
        self.assertEqual(self.stranger.get(sightings["sightings"][0]["image"])[0], 401)

    def test_a_hazard_on_the_line_between_the_parts_is_one_on_the_map(self):
        self.start()
        for name, part in self.metro.parts.items():
            part.add("pothole", *self.metro.border)
            part.add("debris", *self.metro.places[name])
        eventually(lambda: len(self.stranger.hazards()) == 3, f"{len(self.stranger.hazards())} hazards, not 3")
        self.assertIn("livemap_region_duplicates 1", self.metro.region.get("/metrics"))
        # Whichever is shown: closed in its part, the other one takes its place, and is closed as well.
        shown = [one for one in self.stranger.hazards().values() if one["properties"]["class"] == "pothole"]
        self.assertEqual(len(shown), 1)
        self.assertEqual(self.alice.decide(shown[0]["id"], "close")[0], 200)

    def test_while_one_part_is_killed_the_other_one_goes_on_and_nothing_is_decided_late(self):
        self.start()
        self.metro.report("metro-1")
        self.metro.report("metro-2")
        found = self.candidates(2)
        part = self.metro.parts["metro-2"]
        part.door.close()
        part.kill()
        for what in ("confirm", "comment"):
            status, told = self.alice.decide(found["metro-2"], what, {"text": "seen"} if what == "comment" else {})
            self.assertEqual((status, told["error"]), (503, "zone 'metro-2' does not answer"))
        self.assertEqual(self.alice.get(f"/api/v1/hazards/{found['metro-2']}/events")[0], 503)
        # Its last state stays.
        self.assertEqual(self.alice.get(f"/api/v1/hazards/{found['metro-2']}")[1]["properties"]["state"], "candidate")
        self.assertEqual(self.alice.decide(found["metro-1"], "confirm")[0], 200)
        eventually(lambda: self.trail()[1]["missing"] == ["metro-2"], "the part that is down is not named")
        self.assertEqual([line[:2] for line in self.trail()[0]], [("metro-1", "confirm")])
        part.door.open()
        part.start()
        eventually(lambda: self.trail()[1]["missing"] == [], "the part is not back")
        self.assertEqual(self.decisions_of("metro-2"), [])
        self.assertEqual(self.alice.decide(found["metro-2"], "confirm")[0], 200)

    def test_a_decision_without_an_answer_is_not_sent_again(self):
        self.start()
        self.metro.report("metro-1")
        found = self.candidates(1)
        mute = Mute()
        self.addCleanup(mute.listener.close)
        door = self.metro.parts["metro-1"].door
        port, door.target = door.target, mute.port
        status, told = self.alice.decide(found["metro-1"], "confirm")
        self.assertEqual(status, 504)
        self.assertIn("zone 'metro-1' has not answered, and may have done it", told["error"])
        door.target = port
        eventually(lambda: self.trail()[1]["missing"] == [], "the part is not back")
        self.assertEqual((mute.posts, self.decisions_of("metro-1")), (1, []))

    def test_who_is_no_official_decides_nothing(self):
        self.start()
        self.metro.report("metro-1")
        hazard = self.candidates(1)["metro-1"]
        token = self.metro.parts["metro-1"].process.region_token
        self.assertEqual(self.stranger.decide(hazard, "confirm")[0], 401)
        self.assertEqual(self.stranger.decide(hazard, "confirm", Authorization=f"Bearer {token}")[0], 401)
        self.assertEqual(Client(self.metro.region.url).log_in("vera").decide(hazard, "confirm")[0], 403)
        self.assertEqual(self.alice.decide(hazard, "confirm", X_CSRF_Token="0" * 64)[0], 403)
        self.assertEqual(self.alice.decide(hazard, "confirm", Origin="https://evil.example")[0], 403)
        self.assertEqual(self.alice.decide(hazard, "confirm", X_LiveMap_On_Behalf_Of="vera")[0], 403)
        for path in ("/api/v1/decisions", "/api/v1/assignments", "/api/v1/statistics", f"/api/v1/hazards/{hazard}/events",
                     f"/api/v1/hazards/{hazard}/sightings"):
            self.assertEqual(self.stranger.get(path)[0], 401, path)
        self.assertEqual(self.alice.ask("DELETE", "/api/v1/session")[0], 200)
        self.assertEqual(self.alice.decide(hazard, "confirm")[0], 401)
        self.assertEqual(self.decisions_of("metro-1"), [])

    def test_a_part_takes_the_name_of_another_from_a_token_alone_that_may_speak_for_others(self):
        self.start(speaks=False)
        own = self.metro.report("metro-1")
        hazard = self.candidates(1)["metro-1"]
        status, told = self.alice.decide(hazard, "confirm")
        self.assertEqual(status, 403)
        self.assertIn("zone 'metro-1' refuses", told["error"])
        part = self.metro.parts["metro-1"]
        direct = Client(part.url)
        for name in HOSTILE_NAMES:
            # As bytes: what a program can send.
            status, told = direct.decide(own, "confirm", Authorization=f"Bearer {part.process.region_token}",
                                         X_LiveMap_On_Behalf_Of=name.encode())
            self.assertEqual(status, 400, repr(name))
        self.assertEqual(self.decisions_of("metro-1"), [])


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--server", required=True)
    parser.add_argument("--region", required=True)
    parser.add_argument("--user", required=True)
    parser.add_argument("tests", nargs="*")
    parser.parse_args(namespace=OPTIONS)
    program = unittest.main(argv=[sys.argv[0], *OPTIONS.tests], exit=False, verbosity=2)
    return 0 if program.result.wasSuccessful() else 1


sys.exit(main())
