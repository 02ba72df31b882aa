#!/usr/bin/python3
"""The short form of `./livemap bench faults --only kill_active --only pause_active`: a few rounds of each.

Real processes throughout: two launches of the zone, two vehicles, a broker, a server of PostgreSQL.
"""

import pathlib
import shutil
import tempfile
import unittest

import fault_rounds
import postgresql_server
from failover_world import FailoverWorld

SEED = 4
# A machine that does much else beside it may be slower: the bound is the bench's to keep.
TEST_ONLY = ("late", "map_back_s")


@unittest.skipUnless(postgresql_server.programs(), "skipped, no PostgreSQL server installed")
class FailoverTest(unittest.TestCase):
    """One LiveMap that everything happens to."""

    @classmethod
    def setUpClass(cls):
        cls.directory = pathlib.Path(tempfile.mkdtemp(prefix="livemap_failover_"))
        cls.addClassCleanup(shutil.rmtree, cls.directory, ignore_errors=True)
        cls.world = FailoverWorld(cls.directory / "world", SEED)
        cls.world.__enter__()
        cls.addClassCleanup(cls.world.__exit__)

    def assert_nothing_is_lost_or_doubled(self, kind):
        for number in range(2):
            record = fault_rounds.run_round(self.world, kind, SEED, number)
            print(record, flush=True)
            judged = {key: value for key, value in record.items() if key not in TEST_ONLY}
            self.assertTrue(fault_rounds.is_clean(judged), record)
            self.assertGreater(record["reports"], 0)
            self.assertGreater(record["notices"], 0)
            self.assertEqual(record["epochs"], 1, "one other process took over")

    def test_nothing_is_lost_or_told_twice_when_the_active_process_is_killed(self):
        self.assert_nothing_is_lost_or_doubled("kill_active")

    def test_a_paused_process_that_lost_its_lease_ends_and_writes_nothing(self):
        self.assert_nothing_is_lost_or_doubled("pause_active")


if __name__ == "__main__":
    unittest.main()
