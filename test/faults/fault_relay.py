#!/usr/bin/python3
"""A TCP relay that delays, holds or resets what goes through it.

Reads one command a line from standard input: `pass`, `delay SECONDS` (each way), `hold` (a black hole: nothing comes
through, nothing is closed), `reset` (every connection ends with a reset, new ones at once), `end`.
"""

import argparse
import asyncio
import socket
import struct
import sys

CHUNK_BYTES = 1 << 16
# Per direction; then the sender has to wait, as on a line that is full.
MOST_WAITING_CHUNKS = 4096


class Relay:
    def __init__(self, upstream):
        self.upstream = upstream
        self.delay_s = 0.0
        self.resetting = False
        self.open = asyncio.Event()
        self.open.set()
        self.writers = set()

    def command(self, words):
        self.resetting = words[0] == "reset"
        self.delay_s = float(words[1]) if words[0] == "delay" else 0.0
        (self.open.clear if words[0] == "hold" else self.open.set)()
        if self.resetting:
            for writer in list(self.writers):
                reset(writer)

    async def serve(self, reader, writer):
        if self.resetting:
            return reset(writer)
        try:
            await self.open.wait()
            up_reader, up_writer = await asyncio.open_connection(*self.upstream)
        except OSError:
            return reset(writer)
        self.writers |= {writer, up_writer}
        ways = [asyncio.ensure_future(self.carry(reader, up_writer)), asyncio.ensure_future(self.carry(up_reader, writer))]
        await asyncio.wait(ways, return_when=asyncio.FIRST_COMPLETED)
        for way in ways:
            way.cancel()
        await asyncio.gather(*ways, return_exceptions=True)
        self.writers -= {writer, up_writer}
        # One side ended: so does the other, and what was under way is lost, as with a cut line.
        reset(writer)
        reset(up_writer)

    async def carry(self, reader, writer):
        waiting = asyncio.Queue(MOST_WAITING_CHUNKS)
        sending = asyncio.ensure_future(self.send(waiting, writer))
        try:
            while True:
                data = await reader.read(CHUNK_BYTES)
                await waiting.put((asyncio.get_running_loop().time() + self.delay_s, data))
                if not data:
                    await sending
                    return
        finally:
            sending.cancel()

    async def send(self, waiting, writer):
        while True:
            due, data = await waiting.get()
            await asyncio.sleep(due - asyncio.get_running_loop().time())
            await self.open.wait()
            if not data:
                return
            writer.write(data)
            await writer.drain()


def reset(writer):
    """Closes with RST instead of FIN, at once."""
    connection = writer.get_extra_info("socket")
    if connection is not None and connection.fileno() >= 0:
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    writer.transport.abort()


async def run(options):
    relay = Relay((options.to_address, options.to_port))
    server = await asyncio.start_server(relay.serve, "127.0.0.1", options.port)
    commands = asyncio.StreamReader()
    loop = asyncio.get_running_loop()
    await loop.connect_read_pipe(lambda: asyncio.StreamReaderProtocol(commands), sys.stdin)
    print("listening", flush=True)
    async with server:
        async for line in commands:
            words = line.decode().split()
            if not words or words[0] == "end":
                break
            relay.command(words)
            print("done", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--port", type=int, required=True, help="to listen on, at 127.0.0.1")
    parser.add_argument("--to-address", required=True)
    parser.add_argument("--to-port", type=int, required=True)
    asyncio.run(run(parser.parse_args()))


if __name__ == "__main__":
    main()
