"""Who owes what: every report that entered a vehicle's outbox, held against the zone's store.

A trigger writes each row of a vehicle's outbox into a table of our own, in the outbox's transaction: the journal has a
report if and only if the outbox accepted it, however short its row lived and whatever died. The zone's store says what
is on the map. Nothing here believes a counter of the programs under test.
"""

import collections
import pathlib
import shutil
import sqlite3
import tempfile
import uuid

JOURNAL = """
CREATE TABLE IF NOT EXISTS fault_journal(entry INTEGER PRIMARY KEY, uuid BLOB NOT NULL UNIQUE,
  class_name TEXT NOT NULL, stamp_ns INTEGER NOT NULL);
CREATE TRIGGER IF NOT EXISTS fault_journal_writer AFTER INSERT ON pending BEGIN
  INSERT INTO fault_journal(uuid, class_name, stamp_ns) VALUES(new.uuid, new.class_name, new.stamp_ns);
END;
"""

# entered: uuid to what was seen (its class and the image's stamp: the feeder shows each thing in one image only).
# pending: uuid to whether it was sent before.
Outbox = collections.namedtuple("Outbox", "entered pending")
# reports: uuid to hazard; sightings: hazard to the number that the zone keeps for it.
Map = collections.namedtuple("Map", "reports sightings")


class Verdict(collections.namedtuple("Verdict", "lost doubled unknown words")):
    """Uuids of reports lost, hazards and things counted wrongly, reports that were sent without an outbox."""

    @property
    def clean(self):
        return not (self.lost or self.doubled or self.unknown)


def open_for_reading(path):
    return sqlite3.connect(f"file:{path}?mode=ro", uri=True, timeout=10)


def start_journal(path):
    with sqlite3.connect(path, timeout=10) as database:
        database.executescript(JOURNAL)
    database.close()


def read_outbox(path):
    database = open_for_reading(path)
    try:
        database.execute("BEGIN")
        entered = {uuid.UUID(bytes=row[0]): row[1:] for row in
                   database.execute("SELECT uuid, class_name, stamp_ns FROM fault_journal")}
        pending = {uuid.UUID(bytes=row[0]): bool(row[1]) for row in
                   database.execute("SELECT uuid, sent FROM pending")}
        return Outbox(entered, pending)
    finally:
        database.close()


def read_pending(path):
    database = open_for_reading(path)
    try:
        return {uuid.UUID(bytes=row[0]) for row in database.execute("SELECT uuid FROM pending")}
    finally:
        database.close()


def empty_log(path):
    """Plays SQLite's write-ahead log in and truncates it, if nobody is just reading."""
    database = sqlite3.connect(path, timeout=1)
    try:
        database.execute("PRAGMA wal_checkpoint(TRUNCATE)").fetchall()
    finally:
        database.close()


def count_entered(path):
    database = open_for_reading(path)
    try:
        return database.execute("SELECT coalesce(max(entry), 0) FROM fault_journal").fetchone()[0]
    finally:
        database.close()


def read_map(path):
    """Of a file of SQLite, or of what reads a server's database itself."""
    if not isinstance(path, (str, pathlib.Path)):
        return path.read()
    database = open_for_reading(path)
    try:
        database.execute("BEGIN")
        reports = {uuid.UUID(row[0]): row[1] for row in database.execute("SELECT uuid, hazard_id FROM reports")}
        sightings = dict(database.execute("SELECT id, sightings FROM hazards"))
        return Map(reports, sightings)
    finally:
        database.close()


def as_it_lies(path, read):
    """Reads the store of a dead process without touching it: the process's own recovery is under test."""
    with tempfile.TemporaryDirectory(prefix="livemap_dead_store_") as folder:
        copy = pathlib.Path(folder, pathlib.Path(path).name)
        for companion in ("", "-wal"):
            if pathlib.Path(f"{path}{companion}").exists():
                shutil.copyfile(f"{path}{companion}", f"{copy}{companion}")
        # Opened for writing once, so that SQLite plays the log in.
        sqlite3.connect(copy).execute("SELECT count(*) FROM sqlite_master").fetchall()
        return read(copy)


def judge(outboxes, zone_map):
    """What is wrong with the map, if the outboxes were read before it and it was read after them.

    A report may wait, or be on the map, or both for a moment; never neither. What entered an outbox after the reading
    is on the map of no outbox yet: see `strangers`."""
    entered = {report: thing for outbox in outboxes for report, thing in outbox.entered.items()}
    waiting = {report for outbox in outboxes for report in outbox.pending}
    lost = sorted(str(report) for report in entered if report not in waiting and report not in zone_map.reports)
    words = [f"report {report} of {entered[uuid.UUID(report)]} left the outbox and is not on the map" for report in lost]
    doubled = wrong_counts(zone_map, words) + things_twice(entered, zone_map, words)
    return Verdict(lost, doubled, [], words)


def wrong_counts(zone_map, words):
    """Hazards whose number of sightings is not the number of their reports."""
    reports_of = collections.Counter(zone_map.reports.values())
    wrong = [hazard for hazard in set(reports_of) | set(zone_map.sightings)
             if zone_map.sightings.get(hazard) != reports_of.get(hazard)]
    words += [f"hazard {hazard} counts {zone_map.sightings.get(hazard)} sightings and has {reports_of.get(hazard)} reports"
              for hazard in wrong]
    return sorted(wrong)


def things_twice(entered, zone_map, words):
    """Things that stand on the map as two hazards, and hazards made of two things."""
    hazards_of, things_of = collections.defaultdict(set), collections.defaultdict(set)
    for report, thing in entered.items():
        hazard = zone_map.reports.get(report)
        if hazard is not None:
            hazards_of[thing].add(hazard)
            things_of[hazard].add(thing)
    twice = [f"{thing}" for thing, hazards in hazards_of.items() if len(hazards) > 1]
    mixed = [hazard for hazard, things in things_of.items() if len(things) > 1]
    words += [f"{thing} is on the map more than once" for thing in twice]
    words += [f"hazard {hazard} was made of {sorted(things_of[hazard])}" for hazard in mixed]
    return sorted(twice + mixed)


def strangers(zone_map, outboxes):
    """Reports on the map that no outbox had before, if the map was read first: sent before they were safe."""
    entered = set().union(*(outbox.entered for outbox in outboxes))
    return sorted(str(report) for report in set(zone_map.reports) - entered)


class Ledger:
    """The stores of one zone and its vehicles."""

    def __init__(self, outbox_paths, map_path):
        self.outbox_paths, self.map_path = list(outbox_paths), map_path

    def outboxes(self):
        return [read_outbox(path) for path in self.outbox_paths]

    def pending(self):
        return set().union(*(read_pending(path) for path in self.outbox_paths))

    def entered(self):
        """How many reports each outbox accepted so far."""
        return [count_entered(path) for path in self.outbox_paths]

    def merged(self):
        """Hazards that both vehicles reported."""
        return sum(sightings > 1 for sightings in read_map(self.map_path).sightings.values())

    def judge(self, outboxes=None, zone_map=None):
        """Of the stores as they are, or of readings made when something was dead (outboxes first, then the map)."""
        outboxes = self.outboxes() if outboxes is None else outboxes
        zone_map = read_map(self.map_path) if zone_map is None else zone_map
        verdict = judge(outboxes, zone_map)
        unknown = strangers(zone_map, self.outboxes())
        words = verdict.words + [f"report {report} is on the map and never was in an outbox" for report in unknown]
        return Verdict(verdict.lost, verdict.doubled, unknown, words)
