"""The movement of vehicles in a square city of crossing streets, made with SUMO, as livemap_fleet_load reads it."""

import array
import random
import re
import shutil
import struct
import subprocess

from process_end import how_it_ended
from system_error import StartError

# As livemap_fleet_load has its city.
SIDE_M, BLOCK_M = 20000, 400
# Vehicles enter the city over so long; some more than are wanted, for those that arrive.
ENTRY_S, BEGIN_S, SPARE = 60, 70, 1.15
SHORTEST_TRIP_M = 6000

EDGE = re.compile(r'<edge id="([A-Za-z0-9]+)" from="\w+" to="\w+"[^>]*>\s*<lane [^>]*shape="([-0-9.]+),([-0-9.]+)')
STEP = re.compile(r'<timestep time="([0-9.]+)"')
VEHICLE = re.compile(r'<vehicle id="(\d+)" x="([-0-9.]+)" y="([-0-9.]+)" angle="([0-9.]+)" speed="([0-9.]+)"')


def require_sumo():
    for program in ("netgenerate", "sumo"):
        if not shutil.which(program):
            raise StartError(f"'{program}' is not installed, --movement sumo needs it: apt install sumo, "
                             "or give --movement grid")


def run(command, log):
    with open(log, "w", encoding="utf-8") as output:
        done = subprocess.run(command, stdout=output, stderr=subprocess.STDOUT, check=False)
    if done.returncode != 0:
        raise StartError(f"{command[0]} {how_it_ended(done.returncode)}, see {log}")


def write_trips(path, edges, vehicles, seed):
    draw = random.Random(seed)
    lines = ["<routes>"]
    for vehicle in range(vehicles):
        while True:
            (begin, x0, y0), (end, x1, y1) = draw.choice(edges), draw.choice(edges)
            if abs(x0 - x1) + abs(y0 - y1) >= SHORTEST_TRIP_M:
                break
        lines.append(f'<trip id="{vehicle}" depart="{vehicle * ENTRY_S // vehicles}" departPos="random" '
                     f'departSpeed="max" departLane="random" from="{begin}" to="{end}"/>')
    path.write_text("\n".join(lines + ["</routes>"]), encoding="utf-8")


def read_steps(path):
    """The places of each second: by vehicle east, north, course in radians and speed."""
    steps = []
    with open(path, encoding="utf-8") as file:
        for line in file:
            if STEP.search(line):
                steps.append({})
            elif steps and (found := VEHICLE.search(line)):
                x, y, angle, speed = map(float, found.groups()[1:])
                steps[-1][int(found.group(1))] = (x, y, angle * 3.141592653589793 / 180, speed)
    return steps


def write_trace(folder, vehicles, seconds, seed=1):
    """Path of a trace of so many vehicles that are in the city all the time."""
    require_sumo()
    net, trips, places = folder / "city.net.xml", folder / "trips.xml", folder / "places.xml"
    run(["netgenerate", "--grid", "--grid.number", str(SIDE_M // BLOCK_M + 1), "--grid.length", str(BLOCK_M),
         "--default.lanenumber", "2", "--no-internal-links", "-o", str(net)], folder / "netgenerate.log")
    edges = [(name, float(x), float(y)) for name, x, y in EDGE.findall(net.read_text(encoding="utf-8"))]
    write_trips(trips, edges, int(vehicles * SPARE) + 20, seed)
    run(["sumo", "-n", str(net), "-r", str(trips), "--end", str(BEGIN_S + seconds + 1), "--seed", str(seed),
         "--no-internal-links", "--fcd-output", str(places), "--fcd-output.attributes", "x,y,angle,speed",
         "--device.fcd.begin", str(BEGIN_S), "--no-step-log", "--no-warnings", "--routing-algorithm", "astar",
         "--xml-validation", "never", "--xml-validation.net", "never"], folder / "sumo.log")
    steps = read_steps(places)[:seconds]
    always = sorted(set.intersection(*(set(step) for step in steps))) if steps else []
    if len(steps) < seconds or len(always) < vehicles:
        raise StartError(f"SUMO's trace has {len(always)} vehicles over {len(steps)} s, {vehicles} over {seconds} s are "
                         f"wanted: see {folder / 'sumo.log'}")
    trace = folder / "trace.bin"
    with open(trace, "wb") as file:
        file.write(struct.pack("<II", vehicles, seconds))
        for step in steps:
            array.array("f", [value for vehicle in always[:vehicles] for value in step[vehicle]]).tofile(file)
    return trace
