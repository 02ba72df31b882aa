"""The page of the fault rounds: what their records say, in a table."""

import datetime
import pathlib
import statistics
import sys
import textwrap

from fault_kinds import KINDS

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "scripts" / "lib"))
import measured_on  # noqa: E402

HEAD = """# Faults: what is lost

`./livemap bench faults` makes this page; do not edit it. [Delivery](../explanation/delivery.md) and
[the vehicle's outbox](../explanation/duplicates-and-outbox.md) say what is promised, and by what
means.

Machine: {machine}.

Two vehicles, a broker with certificates and a zone run as real processes, started by their own
launch files. Each vehicle and the zone have a ROS master of their own. Between the vehicles'
network namespace and the zone's is one wire, and one of the vehicles reaches it through a TCP
relay. A feeder shows both vehicles the same street: 5 images a second with 3 things each. Each
vehicle sees two thirds of them, so one in three is reported by both and must become one hazard with
two sightings.

A round: reports flow; at a random moment (by seed {seed}, mostly while some report is under way)
the fault strikes; reports go on; the fault ends; the vehicles rest. Then the page counts

- **lost**: a report that entered an outbox, does not wait in it and is not in the zone's store;
- **doubled**: a hazard whose number of sightings is not that of its reports, a thing that became
  two hazards, a hazard made of two things;
- **unknown**: a report in the zone's store that no outbox had made durable before;
- **stuck**: a report that still waits {bound} s after the fault.

A trigger in the outbox's own database records, in the same transaction, what entered the outbox;
the program does not. The stores of killed processes are copied and judged as they lie, before
anything is started again. Kills are of processes: that a row survives a power cut as well rests on
SQLite's `synchronous=FULL` and is not tested here.

**Recovery** is the time from the fault's end (for a kill: from the restart's begin) until
everything is answered that waited then; rounds in which nothing waited have none. The rounds follow
each other within seconds. A connection that lived less than 5 s counts as a failure, so the
bridges' pauses grow to their longest, 10 s (`reconnect_max_s` of [the
bridge](../reference/nodes/mqtt_bridge.md)). That is most of the recovery where connections are cut.
A single cut is followed by a pause of 0.5 s at most. The zone's recovery includes its roslaunch:
1.2 s of processor time, 10.6 s on two cores at load 18 (n = 1).

"""
COLUMNS = ("fault", "rounds", "reports", "waited at the fault's end", "lost", "doubled", "unknown", "stuck",
           "recovery p50, s", "p95, s", "longest, s", "n", "at")

KEEPALIVE_GIVES_UP_S = 22.5


def quantile(values, share):
    return f"{sorted(values)[min(len(values) - 1, int(share * len(values)))]:.1f}" if values else ""


def machine():
    return f"{measured_on.cores()} cores ({measured_on.processor()}, shared)"


def row(kind, records):
    done = [record for record in records if "failed" not in record]
    recoveries = [record["recovery_s"] for record in done if record["recovery_s"] is not None]
    sums = [str(sum(record[key] for record in done))
            for key in ("reports", "waiting", "lost", "doubled", "unknown", "stuck")]
    return [KINDS[kind].words, str(len(done)), *sums, quantile(recoveries, 0.5), quantile(recoveries, 0.95),
            quantile(recoveries, 1), str(len(recoveries)), ", ".join(sorted({record["commit"] for record in records}))]


def table(rows):
    return "\n".join(f"| {' | '.join(cells)} |" for cells in [COLUMNS, ["---"] * len(COLUMNS), *rows]) + "\n"


def notes(records_of):
    lines = []
    phases = {}
    for record in records_of.get("kill_vehicle", []):
        for phase, number in record.get("phases", {}).items():
            phases[phase] = phases.get(phase, 0) + number
    if phases:
        words = ", ".join(f"{number} {phase}" for phase, number in sorted(phases.items()))
        lines.append(f"Where the killed vehicles' unfinished reports stood: {words}.")
    seconds = [record["seconds"] for record in records_of.get("black_hole", []) if "seconds" in record]
    if seconds:
        longer = sum(value > KEEPALIVE_GIVES_UP_S for value in seconds)
        lines.append(f"Black holes lasted {min(seconds):.1f} to {max(seconds):.1f} s, {longer} of {len(seconds)} longer "
                     f"than the {KEEPALIVE_GIVES_UP_S} s after which the keepalive gives a connection up.")
    for kind in ("full_vehicle", "full_zone"):
        felt = [record["felt"] for record in records_of.get(kind, []) if "felt" in record]
        if felt:
            lines.append(f"{KINDS[kind].words}: in {sum(felt)} of {len(felt)} rounds nothing was accepted any more in the last "
                         "0.8 s before the disk was freed.")
    counted = [record for records in records_of.values() for record in records if "merged" in record]
    if counted:
        lines.append(f"{sum(record['merged'] for record in counted)} hazards were reported by both vehicles, among "
                     f"{sum(record['reports'] for record in counted)} reports ({len(counted)} rounds, those that counted it).")
    failed = [f"{kind} {record['round']}: {record['failed']}" for kind, records in records_of.items()
              for record in records if "failed" in record]
    if failed:
        lines.append("Rounds that could not be run to their end, not in the table: " + "; ".join(failed) + ".")
    everything = [record for records in records_of.values() for record in records]
    loads = [record["load"] for record in everything if "load" in record]
    dates = sorted({record["date"] for record in everything})
    lines.append(f"Measured on {' to '.join(sorted({dates[0], dates[-1]}))} (UTC); load of the machine "
                 f"{statistics.median(loads):.0f} (median, by its load average), up to {max(loads):.0f}.")
    if any(not record["namespaces"] for record in everything):
        lines.append("Skipped, no network namespaces: loss, full disks; the other partitions by relays.")
    return "\n\n".join(textwrap.fill(line, 100) for line in lines) + "\n"


def page(records_of, seed, bound_s):
    """`records_of`: kind to its rounds' records, none empty."""
    command = "```\n./livemap bench faults                      # this page; a run that was cut goes on where it was\n" \
              "./livemap bench faults --only kill_zone --rounds 5\n```\n\n"
    rows = [row(kind, records_of[kind]) for kind in KINDS if kind in records_of]
    return HEAD.format(machine=machine(), seed=seed, bound=bound_s) + command + table(rows) + "\n" + notes(records_of)


def today():
    return datetime.datetime.now(datetime.timezone.utc).strftime("%Y-%m-%d")
