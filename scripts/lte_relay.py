#!/usr/bin/python3
"""A TCP relay that is a mobile network between a vehicle and its zone: delay that varies, and a limited rate each way.

What goes through keeps its order, as TCP's does: a late piece holds back those behind it. Listens at 127.0.0.1 until
it is ended, and writes the bytes that went each way as JSON into --counts.
"""

import argparse
import asyncio
import json
import math
import pathlib
import random
import signal
import sys

CHUNK_BYTES = 1 << 14
# Per direction; then the sender has to wait, as on a line that is full.
MOST_WAITING_CHUNKS = 256
LEAST_DELAY_S = 0.005


class Way:
    """One direction of all connections: they share its rate."""

    def __init__(self, delay_s, sigma_s, bytes_per_s, randomness):
        self.delay_s, self.sigma_s, self.bytes_per_s = delay_s, sigma_s, bytes_per_s
        self.randomness = randomness
        self.free_at = self.last_due = 0.0
        self.bytes = 0

    def due(self, now, size):
        """When `size` bytes that came now come out at the other end."""
        self.bytes += size
        self.free_at = max(now, self.free_at) + size / self.bytes_per_s
        delay = max(LEAST_DELAY_S, self.randomness.gauss(self.delay_s, self.sigma_s)) if self.delay_s else 0.0
        self.last_due = max(self.last_due, self.free_at + delay)
        return self.last_due


async def send(waiting, writer):
    while True:
        due, data = await waiting.get()
        await asyncio.sleep(due - asyncio.get_running_loop().time())
        if not data:
            return
        writer.write(data)
        await writer.drain()


async def carry(way, reader, writer):
    waiting = asyncio.Queue(MOST_WAITING_CHUNKS)
    sending = asyncio.ensure_future(send(waiting, writer))
    try:
        while True:
            data = await reader.read(CHUNK_BYTES)
            await waiting.put((way.due(asyncio.get_running_loop().time(), len(data)), data))
            if not data:
                await sending
                return
    finally:
        sending.cancel()


async def serve(upstream, up, down, reader, writer):
    try:
        up_reader, up_writer = await asyncio.open_connection(*upstream)
    except OSError:
        writer.close()
        return
    ways = [asyncio.ensure_future(carry(up, reader, up_writer)), asyncio.ensure_future(carry(down, up_reader, writer))]
    await asyncio.wait(ways, return_when=asyncio.FIRST_COMPLETED)
    for way in ways:
        way.cancel()
    await asyncio.gather(*ways, return_exceptions=True)
    up_writer.close()
    writer.close()


async def run(options):
    randomness = random.Random(options.seed)
    # The round trip's variance is that of two ways.
    delay_s, sigma_s = options.rtt_ms / 2e3, options.rtt_sigma_ms / 1e3 / math.sqrt(2)
    up, down = (Way(delay_s, sigma_s, mbit_s * 125e3, randomness) for mbit_s in (options.up_mbit_s, options.down_mbit_s))
    loop, ended = asyncio.get_running_loop(), asyncio.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, ended.set)
    server = await asyncio.start_server(
        lambda reader, writer: serve((options.to_address, options.to_port), up, down, reader, writer),
        "127.0.0.1", options.port)
    print("listening", flush=True)
    await ended.wait()
    server.close()
    if options.counts:
        options.counts.write_text(json.dumps({"up_bytes": up.bytes, "down_bytes": down.bytes}) + "\n", encoding="ascii")


def positive(text):
    value = float(text)
    if not 0 < value < 1e6:
        raise argparse.ArgumentTypeError(f"'{text}', accepted is a number above 0")
    return value


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--port", type=int, required=True, help="to listen on, at 127.0.0.1")
    parser.add_argument("--to-address", default="127.0.0.1", help="of the broker (127.0.0.1)")
    parser.add_argument("--to-port", type=int, required=True)
    parser.add_argument("--rtt-ms", type=float, default=0.0, help="mean round trip, ms (0: none is added)")
    parser.add_argument("--rtt-sigma-ms", type=float, default=0.0, help="its standard deviation, ms (0)")
    parser.add_argument("--up-mbit-s", type=positive, default=1000.0, help="to the broker (1000)")
    parser.add_argument("--down-mbit-s", type=positive, default=1000.0, help="from the broker (1000)")
    parser.add_argument("--seed", type=int, default=1, help="of the delays (1)")
    parser.add_argument("--counts", type=pathlib.Path, metavar="FILE", help="written at the end")
    asyncio.run(run(parser.parse_args()))
    return 0


if __name__ == "__main__":
    sys.exit(main())
