"""The page of the attacks: what their records say, in a table."""

import datetime
import pathlib
import statistics
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[3] / "scripts" / "lib"))
import measured_on  # noqa: E402

HEAD = """# Hostile clients and vehicles

`./livemap bench hostile` makes this page; do not edit it. The [threat
model](../explanation/threat-model.md) says what is promised.

Machine: {machine}. Date: {date}. Commit: {commit}.

A real zone with {hazards:,} hazards is attacked for {seconds:g} s at a time, by one kind of attack
after the other. Meanwhile an honest vehicle reports four times a second, a reader at another
address asks for page, vehicles, hazards and classes, an official confirms hazards, and a watcher on
the zone's machine asks for `/healthz` twenty times a second. Attackers, the honest and the zone
share one machine, so the times contain what the attackers themselves cost.

- **memory**: the largest resident size of the zone's process during the attack. It is at most
  {bound} MB: {quiet} MB at rest, 64 MB of answers that are being written
  (`max_held_bytes`), 64 MB of pictures kept, and what one picture costs to decode.
- **p99**: of the time to an answer of `/healthz`, n in brackets.
- **served**: of the requests of reader, official and watcher.
- **lost**, **doubled**: of the honest vehicle's reports, by receipts and by the store.

"""
COLUMNS = ("attack", "memory, MB", "`/healthz` p99, ms (n)", "longest, ms", "reader p99, ms", "official p99, ms",
           "served", "reports", "lost", "doubled", "what came of it")


def machine():
    return f"{measured_on.cores()} cores ({measured_on.processor()}, shared)"


def milliseconds(seconds):
    return f"{1000 * seconds:.0f}"


def outcome(record):
    return ", ".join(f"{key} {value}" if not isinstance(value, dict) else
                     "; ".join(f"{status}: {count}" for status, count in value.items())
                     for key, value in record["came_of_it"].items())


def row(record):
    crew = [record[name] for name in ("watcher", "reader", "official")]
    asked, failed = sum(one["asked"] for one in crew), sum(one["failed"] for one in crew)
    vehicle = record["vehicle"]
    cells = (record["attack"], record["memory_mb"], f"{milliseconds(record['watcher']['p99_s'])} ({record['watcher']['asked']})",
             milliseconds(record["watcher"]["longest_s"]), milliseconds(record["reader"]["p99_s"]),
             milliseconds(record["official"]["p99_s"]), f"{asked - failed} of {asked}", vehicle["sent"], vehicle["lost"],
             vehicle["doubled"], outcome(record))
    return "| " + " | ".join(str(cell) for cell in cells) + " |"


def page(records, hazards, seconds, bound_mb, commit):
    quiet = statistics.median(record["memory_before_mb"] for record in records[:1])
    head = HEAD.format(machine=machine(), date=datetime.date.today().isoformat(), commit=commit, hazards=hazards,
                       seconds=seconds, bound=bound_mb, quiet=round(quiet))
    lines = ["| " + " | ".join(COLUMNS) + " |", "|" + "---|" * len(COLUMNS), *(row(record) for record in records)]
    return head + "\n".join(lines) + "\n"
