"""Those who use the zone while it is attacked: a vehicle, readers, an official, and whoever watches /healthz.

Each counts what it asked, what it was given and how long that took. Addresses of the loopback stand for clients."""

import http.client
import json
import threading
import time

import zone_under_attack

WATCHER, READER, OFFICIAL = "127.0.0.1", "127.0.0.21", "127.0.0.22"


def request(port, source, method, address, body=None, headers=None, patience_s=30):
    """Status and body."""
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=patience_s, source_address=(source, 0))
    try:
        connection.request(method, address, body, headers or {})
        answer = connection.getresponse()
        return answer.status, answer.read()
    finally:
        connection.close()


class Caller:
    """Calls `ask` again and again; `ask` answers whether it was served."""

    def __init__(self, pause_s):
        self.pause_s, self.times_s, self.failures = pause_s, [], []
        self.stopping = threading.Event()
        self.thread = threading.Thread(target=self.work, daemon=True)

    def __enter__(self):
        self.thread.start()
        return self

    def __exit__(self, *_):
        self.stopping.set()
        self.thread.join(zone_under_attack.PATIENCE_S)

    def work(self):
        while not self.stopping.is_set():
            began = time.monotonic()
            try:
                self.ask()
            except Exception as failure:  # pylint: disable=broad-except
                self.failures.append(f"{type(failure).__name__}: {failure}")
            self.times_s.append(time.monotonic() - began)
            self.stopping.wait(self.pause_s)

    def ask(self):
        raise NotImplementedError

    def p99_s(self):
        return sorted(self.times_s)[int(0.99 * (len(self.times_s) - 1))]

    def record(self):
        return {"asked": len(self.times_s), "failed": len(self.failures), "p99_s": round(self.p99_s(), 4),
                "longest_s": round(max(self.times_s), 4), "first_failure": self.failures[0] if self.failures else None}


class Watcher(Caller):
    """Asks /healthz, from the loopback."""

    def __init__(self, zone):
        super().__init__(0.05)
        self.zone = zone

    def ask(self):
        status, body = request(self.zone.port, WATCHER, "GET", "/healthz")
        if status != 200:
            raise AssertionError(f"/healthz: {status} {body[:80]}")


class Reader(Caller):
    """A person's browser: page, vehicles and some hazards."""

    ADDRESSES = ("/", "/api/v1/vehicles", "/api/v1/hazards?limit=100", "/api/v1/classes")

    def __init__(self, zone, source=READER):
        super().__init__(0.1)
        self.zone, self.source, self.turn = zone, source, 0

    def ask(self):
        address = self.ADDRESSES[self.turn % len(self.ADDRESSES)]
        self.turn += 1
        status, body = request(self.zone.port, self.source, "GET", address)
        if status != 200:
            raise AssertionError(f"{address}: {status} {body[:80]}")


class Official(Caller):
    """Confirms one hazard after the other."""

    def __init__(self, zone, ids):
        super().__init__(0.2)
        self.zone, self.ids, self.turn = zone, ids, 0

    def ask(self):
        hazard = self.ids[self.turn % len(self.ids)]
        self.turn += 1
        status, body = request(self.zone.port, OFFICIAL, "POST", f"/api/v1/hazards/{hazard}/confirm", "",
                               {"Authorization": f"Bearer {zone_under_attack.TOKEN}"})
        if status != 200:
            raise AssertionError(f"confirm: {status} {body[:80]}")


class Vehicle(Caller):
    """Reports one hazard after the other, 40 m apart, and sends again what was not answered within 5 s."""

    RESEND_S = 5

    def __init__(self, reporter, name="honest-1"):
        super().__init__(0.25)
        self.reporter, self.name, self.sent, self.sent_at = reporter, name, [], {}

    def ask(self):
        # Slower than it drives: 40 m in 0.25 s would be refused, so stamps run ahead of the reports' own pace.
        place = len(self.sent)
        report = self.reporter.make(f"{self.name}-{place // 50}", 41 + 0.0004 * (place % 50), -80 + 0.001 * (place // 50),
                                    age_s=200 - 3 * (place % 50))
        self.sent.append(report)
        self.send(report)
        now = time.monotonic()
        for other in self.sent:
            if self.reporter.receipt(other) is None and now - self.sent_at[other.uuid] > self.RESEND_S:
                self.send(other)

    def send(self, report):
        self.sent_at[report.uuid] = time.monotonic()
        self.reporter.send(report)

    def settle(self, patience_s=60):
        """Sends again what still waits; answers how many are lost and how many hazards are not theirs alone."""
        deadline = time.monotonic() + patience_s
        while waiting := [report for report in self.sent if self.reporter.receipt(report) is None]:
            if time.monotonic() > deadline:
                break
            for report in waiting:
                self.send(report)
            time.sleep(1)
        receipts = [self.reporter.receipt(report) for report in self.sent]
        committed = [receipt for receipt in receipts if receipt and receipt.status == receipt.COMMITTED]
        refused = [receipt.reason for receipt in receipts if receipt and receipt.status != receipt.COMMITTED]
        return {"sent": len(self.sent), "lost": len(self.sent) - len(committed), "refused": refused[:1],
                "doubled": len(committed) - len({receipt.hazard_uuid for receipt in committed})}


def hazard_ids(zone, count):
    _, body = request(zone.port, WATCHER, "GET", f"/api/v1/hazards?limit={count}")
    return [feature["id"] for feature in json.loads(body)["features"]]
