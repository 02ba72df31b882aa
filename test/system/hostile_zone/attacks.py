"""What is done to the zone. An attack begins with start() and ends with stop(); record() says what came of it.

Attackers that come by HTTP have addresses of the loopback of their own, 127.0.1.x; those that come by MQTT would be
enrolled vehicles, and speak by ROS as the zone's bridge hands it on."""

import base64
import contextlib
import os
import socket
import struct
import threading

import cv2
import numpy

import honest

LISTS = ("/api/v1/hazards?limit=50000", "/api/v1/hazards/points", "/api/v1/hazards?since=1&limit=50000",
         "/api/v1/changes?limit=50000", "/api/v1/vehicles", "/api/v1/classes", "/vendor/leaflet/leaflet.min.js", "/map.js")


def connect(port, source, receive_buffer=None):
    end = socket.socket()
    if receive_buffer:
        end.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_buffer)
    end.settimeout(10)
    end.bind((source, 0))
    end.connect(("127.0.0.1", port))
    return end


def get(address, *fields):
    return ("\r\n".join([f"GET {address} HTTP/1.1", "Host: 127.0.0.1", *fields]) + "\r\n\r\n").encode()


def upgrade(address):
    key = base64.b64encode(os.urandom(16)).decode()
    return get(address, "Connection: Upgrade", "Upgrade: websocket", "Sec-WebSocket-Version: 13",
               f"Sec-WebSocket-Key: {key}")


def frame(opcode, payload, final=True, length=None):
    """A masked frame of RFC 6455; `length` is what the header says."""
    said = len(payload) if length is None else length
    head = bytes([(0x80 if final else 0) | opcode])
    if said < 126:
        head += bytes([0x80 | said])
    elif said < 65536:
        head += bytes([0x80 | 126]) + struct.pack("!H", said)
    else:
        head += bytes([0x80 | 127]) + struct.pack("!Q", said)
    return head + b"\0\0\0\0" + payload


class Attack:
    """`clients` connections, kept open by as many addresses as `addresses`; one that was ended is opened again."""

    name, clients, addresses = "", 60, 1

    def __init__(self, zone, reporter, scale=1.0):
        self.zone, self.reporter = zone, reporter
        self.count = max(1, int(self.clients * scale))
        self.stopping = threading.Event()
        self.opened = self.ended = 0
        self.thread = threading.Thread(target=self.work, daemon=True)

    def start(self):
        self.thread.start()

    def stop(self):
        self.stopping.set()
        self.thread.join(60)

    def source(self, number):
        return f"127.0.{1 + number % self.addresses // 250}.{1 + number % self.addresses % 250}"

    def open(self, number):
        return connect(self.zone.port, self.source(number))

    def keep_at_it(self, end, number):
        """Called every second for an open connection."""

    def work(self):
        ends = {}
        while not self.stopping.is_set():
            for number in range(self.count):
                try:
                    if number not in ends:
                        ends[number] = self.open(number)
                        self.opened += 1
                    self.keep_at_it(ends[number], number)
                except OSError:
                    self.ended += 1
                    with contextlib.suppress(KeyError):
                        ends.pop(number).close()
                if self.stopping.is_set():
                    break
            self.stopping.wait(1)
        for end in ends.values():
            end.close()

    def record(self):
        return {"opened": self.opened, "ended": self.ended}


class ListsUnread(Attack):
    """Ask for everything that is long, and read nothing."""

    name, clients, addresses = "answers that nobody reads", 80, 3

    def open(self, number):
        end = connect(self.zone.port, self.source(number), 4096)
        end.sendall(get(LISTS[number % len(LISTS)] if number % 2 else LISTS[0], "Accept-Encoding: gzip" if number % 3 else "X: y"))
        return end


class StreamsUnread(Attack):
    """Ask the live stream for all that ever happened, and read nothing."""

    name, clients, addresses = "live streams that nobody reads", 120, 4

    def open(self, number):
        end = connect(self.zone.port, self.source(number), 4096)
        end.sendall(upgrade("/ws?since=0"))
        return end


class SlowOnes(Attack):
    """Send a request one byte a second."""

    name, clients, addresses = "260 slow clients of one address", 260, 1

    def open(self, number):
        end = connect(self.zone.port, self.source(number))
        end.sendall(b"GET /api/v1/haz")
        return end

    def keep_at_it(self, end, number):
        end.sendall(b"a")


class SlowNeighbours(SlowOnes):
    """The same from the address of the honest."""

    name, clients = "260 slow clients of the readers' own address", 260

    def source(self, number):
        return honest.READER


class Crowd(Attack):
    """Connections that say nothing, and live streams, from forty addresses."""

    name, clients, addresses = "1000 connections of 40 addresses", 1000, 40

    def open(self, number):
        end = connect(self.zone.port, self.source(number))
        if number % 2:
            end.sendall(upgrade("/ws"))
        return end


class OddRequests(Attack):
    """Pipelined requests, ranges, absurd headers, endless chunked bodies, half-closed sockets, odd methods."""

    name, clients, addresses = "odd requests", 40, 2
    REQUESTS = (
        get("/api/v1/hazards?limit=100") * 50, get("/", "Range: bytes=0-0,1-1,2-2"), b"HEAD /api/v1/hazards HTTP/1.1\r\nHost: x\r\n\r\n" * 20,
        b"OPTIONS * HTTP/1.1\r\nHost: x\r\n\r\n", get("/", "X: " + "y" * 20000), get("/", *["X: y"] * 1500),
        b"POST /api/v1/hazards HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\n" + b"400\r\n" + b"z" * 1024 + b"\r\n",
        b"GET / HTTP/1.0\r\n\r\n", b"\x16\x03\x01" + os.urandom(200), get("/" + "%41" * 1300), get("/images/" + "a" * 64),
        b"GET / HTTP/1.1\r\nHost: x\r\nContent-Length: 10\r\nTransfer-Encoding: chunked\r\n\r\n")

    def open(self, number):
        end = connect(self.zone.port, self.source(number))
        end.sendall(self.REQUESTS[number % len(self.REQUESTS)])
        if number % 4 == 0:
            end.shutdown(socket.SHUT_WR)
        return end

    def keep_at_it(self, end, number):
        end.settimeout(0.01)
        with contextlib.suppress(socket.timeout):
            if not end.recv(65536):
                raise ConnectionResetError
        end.settimeout(10)
        if number % 4:
            end.sendall(b"400\r\n" + b"z" * 1024 + b"\r\n")


class OddFrames(Attack):
    """Live streams with huge, endless, fragmented and broken frames, and floods of pings."""

    name, clients, addresses = "odd frames on live streams", 40, 2
    FRAMES = (frame(1, b"x" * 100, length=1 << 62), frame(1, b"x" * 5000), frame(1, b"a", final=False) + frame(0, b"", final=False) * 200,
              frame(9, b"p" * 125) * 500, frame(3, b"reserved"), b"\xff" * 500, frame(8, b"\x03\xe8"), frame(0, b"lost"))

    def open(self, number):
        end = connect(self.zone.port, self.source(number))
        end.sendall(upgrade("/ws"))
        end.recv(4096)
        return end

    def keep_at_it(self, end, number):
        end.sendall(self.FRAMES[number % len(self.FRAMES)])
        end.settimeout(0.01)
        with contextlib.suppress(socket.timeout):
            if not end.recv(65536):
                raise ConnectionResetError
        end.settimeout(10)


def costly_jpeg(side, seed):
    """A progressive picture: many scans over many pixels, in few bytes."""
    image = numpy.full((side, side, 3), (90, 120, 150), numpy.uint8)
    cv2.circle(image, (side // 2, side // 3), 40 + seed % 300, (0, 0, 255), 9)
    cv2.putText(image, str(seed), (40, side - 40), cv2.FONT_HERSHEY_SIMPLEX, 3, (255, 255, 255), 5)
    return cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_PROGRESSIVE, 1, cv2.IMWRITE_JPEG_QUALITY, 60])[1].tobytes()


def plain_jpeg(side, seed):
    image = numpy.full((side, side, 3), (90, 120, 150), numpy.uint8)
    cv2.putText(image, str(seed), (40, side - 40), cv2.FONT_HERSHEY_SIMPLEX, 3, (255, 255, 255), 5)
    return cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, 60])[1].tobytes()


def deep_png(side, seed):
    """Sixteen bits, four channels: eight bytes a pixel, of which the file has almost none."""
    image = numpy.zeros((side, side, 4), numpy.uint16)
    image[0, :, 0] = seed
    return cv2.imencode(".png", image, [cv2.IMWRITE_PNG_COMPRESSION, 9])[1].tobytes()


class CostlyPictures(Attack):
    """Reports with pictures that cost much to decode; then everybody asks for all of them at once."""

    name, clients, addresses = "costly pictures, asked for at once", 30, 1

    def __init__(self, zone, reporter, scale=1.0):
        super().__init__(zone, reporter, scale)
        self.statuses, self.kept, self.reports = {}, 0, []

    def start(self):
        makers = (lambda seed: costly_jpeg(4470, seed), lambda seed: plain_jpeg(4400, seed), lambda seed: deep_png(2500, seed))
        for number in range(self.count):
            self.reports.append(self.reporter.make(f"painter-{number}", 42 + 0.001 * number, -81, image=makers[number % 3](number),
                                                   image_format="png" if number % 3 == 2 else "jpeg"))
        for report in self.reports:
            self.reporter.send(report)
        super().start()

    def work(self):
        # Twelve of them ask for one after the other, again and again.
        askers = [threading.Thread(target=self.ask, args=(turn,), daemon=True) for turn in range(12)]
        for asker in askers:
            asker.start()
        for asker in askers:
            asker.join(120)

    def ask(self, turn):
        import hashlib
        names = [hashlib.sha256(bytes(report.image.data)).hexdigest() for report in self.reports]
        while not self.stopping.is_set():
            for number in range(len(names)):
                if self.stopping.is_set():
                    return
                try:
                    status, _ = honest.request(self.zone.port, self.source(0), "GET", f"/images/{names[(number + turn) % len(names)]}")
                except OSError:
                    status = "ended"
                self.statuses[status] = self.statuses.get(status, 0) + 1
            self.stopping.wait(0.05)

    def record(self):
        return {"opened": sum(value for value in self.statuses.values()), "answers": {str(key): value for key, value in
                                                                                      sorted(self.statuses.items(), key=str)}}


class Lies(Attack):
    """What a hostile vehicle tells; each is asked for its receipt. Subclasses say what is sent."""

    addresses = 1

    def __init__(self, zone, reporter, scale=1.0):
        super().__init__(zone, reporter, scale)
        self.reports = []

    def tell(self, number):
        raise NotImplementedError

    def work(self):
        for number in range(self.count):
            if self.stopping.is_set():
                break
            self.reports.append(self.tell(number))
            self.reporter.send(self.reports[-1])
            if number % 100 == 99:
                self.stopping.wait(0.05)

    def record(self):
        receipts = [receipt for report in self.reports if (receipt := self.reporter.receipt(report))]
        accepted = sum(receipt.status == receipt.COMMITTED for receipt in receipts)
        return {"sent": len(self.reports), "accepted": accepted, "refused": len(receipts) - accepted,
                "not_taken": len(self.reports) - len(receipts)}


CITIES = ((40.44, -79.99), (48.86, 2.35), (-33.87, 151.21), (35.68, 139.69), (52.52, 13.40), (-23.55, -46.63),
          (55.75, 37.62), (28.61, 77.21), (1.35, 103.82), (64.15, -21.94))


class ManyCities(Lies):
    """One vehicle in ten cities within minutes, by stamps in any order."""

    name, clients = "stamps in any order: one vehicle in ten cities", 40

    def tell(self, number):
        latitude, longitude = CITIES[number % len(CITIES)]
        self.reporter.tell_position("wanderer", latitude, longitude, age_s=(number * 37) % 600, speed=1e30)
        return self.reporter.make("wanderer", latitude + 0.001 * number, longitude, age_s=30 + (number * 37) % 600)


class SpamNames(Lies):
    """A class name that nobody has heard of with every report; among them blank and look-alike ones."""

    name, clients = "spam class names", 400
    ODD = ("pothole ", " pothole", "p\u043ethole", "POTHOLE", "\u2003", "pot\u00adhole", "potho\u200ble", "x" * 64)

    def tell(self, number):
        name = self.ODD[number % len(self.ODD)] if number % 10 == 0 else f"spam {number}"
        return self.reporter.make(f"spammer-{number // 100}", 43 + 0.0005 * (number % 100), -82 + 0.01 * (number // 100), name,
                                  age_s=200 - 2 * (number % 100) + 1)


class Flood(Lies):
    """One vehicle reports as fast as it can."""

    name, clients = "a flood of reports of one vehicle", 20000

    def tell(self, number):
        return self.reporter.make("flooder", 44 + 0.00001 * (number % 1000), -83, age_s=1)


class AskingAlways(Attack):
    """One vehicle asks about as many cells as it can as fast as it can, and among them about impossible ones."""

    name, clients = "a flood of questions about cells", 20000

    def work(self):
        for number in range(self.count):
            if self.stopping.is_set():
                return
            self.reporter.ask_cells("asker", [(number * 64 + i) % (1 << 30) for i in range(64)], odd=number % 10 == 0)
            self.opened += 1
            if number % 100 == 99:
                self.stopping.wait(0.05)

    def record(self):
        return {"asked": self.opened, "answered_cells": self.reporter.cells_told("asker")}


HTTP_ATTACKS = (ListsUnread, StreamsUnread, SlowOnes, SlowNeighbours, Crowd, OddRequests, OddFrames, CostlyPictures)
VEHICLE_ATTACKS = (ManyCities, SpamNames, Flood)
ATTACKS = HTTP_ATTACKS + VEHICLE_ATTACKS + (AskingAlways,)


def classes_on_map(zone):
    """The classes that the map shows."""
    _, rows = zone.points()
    return {row[3] for row in rows}
