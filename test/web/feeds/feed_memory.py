#!/usr/bin/python3
"""How much memory a real zone's server takes while it writes feeds of very many hazards.

  feed_memory.py --server PATH_OF_map_page_server [--count 100000]

Prints a line of a Markdown table for each feed: its bytes, how long the client took to read it, and how far the
server's resident memory rose above what it was before, at its peak.
"""

import argparse
import pathlib
import sys
import time
import urllib.request

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "page"))
from map_page_fixture import OPTIONS, ZoneProcess  # noqa: E402

FEEDS = ("feeds/hazards.csv", "feeds/hazards.atom", "feeds/hazards.gpx", "feeds/cifs.json", "feeds/srti.xml",
         "feeds/denm.ndjson", "feeds/wzdx.geojson", "ogc/collections/hazards/items?limit=10000")


def memory(process, key):
    """A line of /proc/PID/status, in MB."""
    for line in pathlib.Path(f"/proc/{process.pid}/status").read_text().splitlines():
        if line.startswith(key + ":"):
            return int(line.split()[1]) / 1024
    raise RuntimeError(f"/proc has no {key}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--server", required=True, help="the built map_page_server")
    parser.add_argument("--count", type=int, default=100000, help="number of hazards")
    parser.parse_args(namespace=OPTIONS)
    zone = ZoneProcess()
    for number, name in enumerate(("barrier", "deer")):
        hazards = zone.do("row", **{"class": name}, count=OPTIONS.count // 2, lat=40.0, lon=-79.9 + number)["hazards"]
    print(f"{hazards} hazards\n\n| feed | MB | s | peak above before, MB |\n|---|---|---|---|")
    for path in FEEDS:
        before = memory(zone.process, "VmRSS")
        pathlib.Path(f"/proc/{zone.process.pid}/clear_refs").write_text("5")
        start, size = time.monotonic(), 0
        with urllib.request.urlopen(zone.url + path, timeout=600) as answer:
            while block := answer.read(1 << 16):
                size += len(block)
        seconds = time.monotonic() - start
        print(f"| `/{path}` | {size / 1e6:.1f} | {seconds:.1f} | {memory(zone.process, 'VmHWM') - before:.1f} |", flush=True)
    zone.close()


if __name__ == "__main__":
    main()
