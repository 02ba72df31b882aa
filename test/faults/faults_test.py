#!/usr/bin/python3
"""The short form of `./livemap bench faults`: a round of every fault; and that the rounds could fail.

Real processes throughout. Where network namespaces are not permitted the faults that need them are skipped, the other
partitions are made by relays.
"""

import contextlib
import os
import pathlib
import shutil
import signal
import sqlite3
import subprocess
import sys
import tempfile
import time
import unittest

import fault_network
import fault_rounds
from fault_kinds import KINDS, Outage
from fault_ledger import Ledger
from fault_world import ROOT, VEHICLES, World, wait_until

# Of short faults.
SEED = 4


class FaultsTest(unittest.TestCase):
    """One LiveMap that everything happens to."""

    @classmethod
    def setUpClass(cls):
        cls.directory = pathlib.Path(tempfile.mkdtemp(prefix="livemap_faults_"))
        cls.addClassCleanup(shutil.rmtree, cls.directory, ignore_errors=True)
        cls.world = World(cls.directory / "world", SEED, small_stores=True)
        cls.world.__enter__()
        cls.addClassCleanup(cls.world.__exit__)

    def assert_nothing_is_lost_or_doubled(self, kind):
        if KINDS[kind].wants_namespaces and not self.world.inside:
            self.skipTest("skipped, no network namespaces")
        for record in fault_rounds.run_rounds(self.world, kind, SEED, [0]):
            print(record, flush=True)
            self.assertTrue(fault_rounds.is_clean(record), record)
            self.assertGreater(record["reports"], 0)
            self.assertTrue(record.get("felt", True), "the disk was full and reports were accepted all the same")

    def test_vehicle_killed(self):
        self.assert_nothing_is_lost_or_doubled("kill_vehicle")

    def test_broker_killed(self):
        self.assert_nothing_is_lost_or_doubled("kill_broker")

    def test_zone_killed(self):
        self.assert_nothing_is_lost_or_doubled("kill_zone")

    def test_broker_restarted_with_empty_state(self):
        self.assert_nothing_is_lost_or_doubled("empty_broker")

    def test_partition_by_reset(self):
        self.assert_nothing_is_lost_or_doubled("reset")

    def test_black_hole(self):
        self.assert_nothing_is_lost_or_doubled("black_hole")

    def test_packet_loss(self):
        self.assert_nothing_is_lost_or_doubled("loss")

    def test_delay(self):
        self.assert_nothing_is_lost_or_doubled("delay")

    def test_flaps(self):
        self.assert_nothing_is_lost_or_doubled("flaps")

    def test_full_disk_of_the_vehicle(self):
        self.assert_nothing_is_lost_or_doubled("full_vehicle")

    def test_full_disk_of_the_zone(self):
        self.assert_nothing_is_lost_or_doubled("full_zone")

    # That the rounds could fail: the promise is broken on purpose.

    def test_a_zone_that_does_not_answer_leaves_reports_stuck_and_one_deleted_then_is_lost(self):
        zone = self.world.pids_of(self.world.ports["zone"], "/zone_cloudlet", "__name:=")
        with stopped(zone):
            self.world.feed()
            wait_until(self.world.ledger.pending, "a report that waits")
            self.world.rest()
            waiting = self.world.ledger.pending()
            outage = Outage(time.monotonic() - fault_rounds.BOUND_S, waiting, [], {})
            recovery_s, stuck = fault_rounds.settle(self.world.ledger, outage)
            self.assertIsNone(recovery_s)
            self.assertGreater(stuck, 0)
            copies = self.copies()
        self.assertTrue(copies.judge().clean)
        victim = min(copies.pending())
        for outbox in copies.outbox_paths:
            change(outbox, "DELETE FROM pending WHERE uuid = ?", victim.bytes)
        self.assertEqual(copies.judge().lost, [str(victim)])
        _, stuck = fault_rounds.settle(self.world.ledger, Outage(time.monotonic(), waiting, [], {}))
        self.assertEqual(stuck, 0, "once it answers again")

    def test_a_report_gone_from_the_zone_is_lost(self):
        copies = self.copies()
        uuid, hazard = change(copies.map_path, "SELECT uuid, hazard_id FROM reports LIMIT 1")[0]
        change(copies.map_path, "DELETE FROM reports WHERE uuid = ?", uuid)
        self.assertEqual(copies.judge().lost, [uuid])
        self.assertEqual(copies.judge().doubled, [hazard], "it has fewer reports than sightings")

    def test_a_report_counted_twice_is_doubled(self):
        copies = self.copies()
        hazard = change(copies.map_path, "SELECT id FROM hazards LIMIT 1")[0][0]
        change(copies.map_path, "UPDATE hazards SET sightings = sightings + 1 WHERE id = ?", hazard)
        self.assertEqual(copies.judge().doubled, [hazard])

    def test_a_thing_that_became_two_hazards_is_doubled(self):
        twice = "SELECT max(uuid), hazard_id FROM reports GROUP BY hazard_id HAVING count(*) = 2 LIMIT 1"
        self.world.feed()
        wait_until(lambda: change(self.world.ledger.map_path, twice), "a hazard that both vehicles reported")
        self.world.rest()
        copies = self.copies()
        uuid, hazard = change(copies.map_path, twice)[0]
        columns = [row[1] for row in change(copies.map_path, "PRAGMA table_info(hazards)")]
        values = ", ".join({"id": "-1", "uuid": "'twin'", "sightings": "1", "sequence": "-1"}.get(name, name) for name in columns)
        change(copies.map_path, f"INSERT INTO hazards SELECT {values} FROM hazards WHERE id = ?", hazard)
        change(copies.map_path, "UPDATE reports SET hazard_id = -1 WHERE uuid = ?", uuid)
        change(copies.map_path, "UPDATE hazards SET sightings = 1 WHERE id = ?", hazard)
        self.assertEqual(len(copies.judge().doubled), 1)

    def test_a_report_that_no_outbox_had_is_unknown(self):
        copies = self.copies()
        stranger = change(copies.outbox_paths[0], "SELECT uuid FROM fault_journal LIMIT 1")[0][0]
        change(copies.outbox_paths[0], "DELETE FROM fault_journal WHERE uuid = ?", stranger)
        self.assertEqual([report.replace("-", "") for report in copies.judge().unknown], [stranger.hex()])

    def copies(self):
        """The stores as they are now, the outboxes before the map."""
        folder = pathlib.Path(tempfile.mkdtemp(dir=self.directory))
        ledger = self.world.ledger
        paths = [folder / f"{name}.sqlite3" for name in (*VEHICLES, "zone")]
        for source, copy in zip([*ledger.outbox_paths, ledger.map_path], paths):
            with contextlib.closing(sqlite3.connect(source)) as original, contextlib.closing(sqlite3.connect(copy)) as target:
                original.backup(target)
        return Ledger(paths[:-1], paths[-1])


class BenchTest(unittest.TestCase):
    def test_wrong_arguments_are_one_sentence_and_exit_code_2(self):
        for flags, words in ((["--rounds", "0"], "--rounds is 0"), (["--only", "rain"], "--only is 'rain'"),
                             (["--root", "/"], "is no source tree")):
            done = subprocess.run([sys.executable, ROOT / "scripts/livemap_bench_faults", *flags], capture_output=True,
                                  text=True, check=False)
            self.assertEqual((done.returncode, done.stdout, done.stderr.count("\n")), (2, "", 1), done.stderr)
            self.assertIn(words, done.stderr)


@contextlib.contextmanager
def stopped(pids):
    for pid in pids:
        os.kill(pid, signal.SIGSTOP)
    try:
        yield
    finally:
        for pid in pids:
            os.kill(pid, signal.SIGCONT)


def change(path, statement, *values):
    with contextlib.closing(sqlite3.connect(path)) as database, database:
        return database.execute(statement, values).fetchall()


if __name__ == "__main__":
    fault_network.enter_own_world()
    if not fault_network.is_inside():
        print("skipped, no network namespaces: partitions by relays", flush=True)
    unittest.main(verbosity=2)
