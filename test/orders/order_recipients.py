"""Recipients of work orders for tests, each of which keeps what it took in a ledger on disk, a JSON object a line.

  order_recipients.py webhook|open311 PORT LEDGER

Standard input says how it behaves from the next request on, a word a line:

  well         it takes the order and answers
  keep-die     it takes the order and is killed (SIGKILL) before it answers
  die          it is killed before it has taken anything
  keep-drop    it takes the order and closes the connection without an answer
  keep-500     it takes the order and answers 500
  keep-stall   it takes the order and does not answer
  busy         it answers 503 and takes nothing
  refuse WORDS (webhook) it answers 422 with these words and takes nothing
  token        (open311) it gives a token in place of an id
  close ID     (open311) the work of the request is done
  flood        it takes the order and answers with many megabytes

`open311` follows GeoReport v2 (https://wiki.open311.org/GeoReport_v2/): POST requests, GET requests with service_code,
start_date and end_date, GET requests/ID, GET tokens/TOKEN. It has no notion of a repeat: what is posted twice is there
twice. `webhook` drops what has an Idempotency-Key that it has seen.
"""

import datetime
import hmac
import http.server
import json
import os
import re
import signal
import socket
import sys
import threading
import time
import urllib.parse

SECRET = b"top-secret-key"
API_KEY = "open-sesame"
SERVICES = {"001"}
JURISDICTION = "city.example"


class Ledger:
    """What was taken; a line is on disk before anybody is answered."""

    def __init__(self, path):
        self.path = path
        self.lock = threading.Lock()

    def read(self):
        try:
            with open(self.path, encoding="utf-8") as file:
                return [json.loads(line) for line in file]
        except FileNotFoundError:
            return []

    def add(self, entry):
        with open(self.path, "a", encoding="utf-8") as file:
            file.write(json.dumps(entry) + "\n")
            file.flush()
            os.fsync(file.fileno())


class Recipient(http.server.BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    mode = "well"
    ledger = None
    closed = set()

    def log_message(self, *_):
        pass

    def answer(self, status, content, kind="application/json"):
        body = content if isinstance(content, bytes) else json.dumps(content).encode()
        self.send_response(status)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        try:
            self.wfile.write(body)
        except OSError:
            pass

    def drop(self):
        self.close_connection = True
        self.connection.shutdown(socket.SHUT_RDWR)

    def is_refused(self):
        """Before anything is kept."""
        if Recipient.mode == "die":
            os.kill(os.getpid(), signal.SIGKILL)
        if Recipient.mode == "busy":
            self.answer(503, {})
        elif Recipient.mode.startswith("refuse "):
            self.answer(422, Recipient.mode.split(" ", 1)[1].encode(), "text/plain; charset=utf-8")
        else:
            return False
        return True

    def is_answered(self):
        """After it is kept: whether all is done as the mode says, and no good answer is to come."""
        mode = Recipient.mode
        if mode == "keep-die":
            os.kill(os.getpid(), signal.SIGKILL)
        if mode == "keep-stall":
            time.sleep(60)
        if mode == "keep-drop":
            self.drop()
        if mode == "keep-500":
            self.answer(500, {})
        if mode == "flood":
            self.answer(200, b"[" + b" " * (32 << 20))
        return mode not in ("well", "token")

    def body(self):
        return self.rfile.read(int(self.headers["Content-Length"]))


class Webhook(Recipient):
    def do_POST(self):
        body = self.body()
        signature = re.fullmatch(r"t=(\d+),v1=([0-9a-f]{64})", self.headers["X-LiveMap-Signature"])
        signed = signature.group(1).encode() + b"." + body
        right = hmac.compare_digest(hmac.new(SECRET, signed, "sha256").hexdigest(), signature.group(2))
        if not right or abs(int(signature.group(1)) - time.time()) > 60:
            self.answer(401, {})
            return
        entry = {"key": self.headers["Idempotency-Key"], "body": body.decode()}
        with self.ledger.lock:
            known = {kept["key"]: kept["body"] for kept in self.ledger.read()}
            if known.get(entry["key"], entry["body"]) != entry["body"]:
                self.answer(422, {})
                return
            if self.is_refused():
                return
            if entry["key"] not in known:
                self.ledger.add(entry)
        if not self.is_answered():
            self.answer(200, {})


class Open311(Recipient):
    def refuse(self, code, description):
        self.answer(code, [{"code": code, "description": description}])

    def do_POST(self):
        if self.path != "/v2/requests.json":
            self.refuse(404, "no such resource")
            return
        form = dict(urllib.parse.parse_qsl(self.body().decode(), strict_parsing=True))
        if self.headers["Content-Type"] != "application/x-www-form-urlencoded":
            self.refuse(400, "the content type is wrong")
        elif form.get("jurisdiction_id") != JURISDICTION:
            self.refuse(404, "jurisdiction_id is not found")
        elif form.get("api_key") != API_KEY:
            self.refuse(403, "the api_key %s is not valid" % form.get("api_key"))
        elif form.get("service_code") not in SERVICES:
            self.refuse(404, "service_code is not found")
        elif not (-90 <= float(form["lat"]) <= 90 and -180 <= float(form["long"]) <= 180):
            self.refuse(400, "lat or long is wrong")
        else:
            with self.ledger.lock:
                if self.is_refused():
                    return
                number = len(self.ledger.read()) + 1
                entry = {key: form[key] for key in ("service_code", "lat", "long", "description")}
                entry.update(service_request_id=str(600 + number), requested=time.time())
                self.ledger.add(entry)
            if not self.is_answered():
                token = {"token": "t%d" % number}
                known = {"service_request_id": str(600 + number), "service_notice": "", "account_id": None}
                self.answer(201, [token if Recipient.mode == "token" else known])

    def do_GET(self):
        path, _, query = self.path.partition("?")
        parameters = dict(urllib.parse.parse_qsl(query))
        entries = [self.shown(entry) for entry in self.ledger.read()]
        if parameters.get("jurisdiction_id") != JURISDICTION:
            self.refuse(404, "jurisdiction_id is not found")
        elif path == "/v2/requests.json":
            begin, end = (datetime.datetime.fromisoformat(parameters[key].replace("Z", "+00:00")).timestamp()
                          for key in ("start_date", "end_date"))
            self.answer(200, [entry for entry, kept in zip(entries, self.ledger.read())
                              if begin <= kept["requested"] <= end and kept["service_code"] == parameters["service_code"]])
        elif path.startswith("/v2/tokens/t"):
            number = int(path[len("/v2/tokens/t"):-len(".json")])
            self.answer(200, [{"token": "t%d" % number, "service_request_id": str(600 + number)}])
        else:
            found = [entry for entry in entries if path == "/v2/requests/%s.json" % entry["service_request_id"]]
            self.answer(200 if found else 404, found)

    def shown(self, entry):
        status = "closed" if entry["service_request_id"] in self.closed else "open"
        return {"service_request_id": entry["service_request_id"], "status": status, "service_code": entry["service_code"],
                "description": entry["description"], "lat": float(entry["lat"]), "long": float(entry["long"])}


def main():
    kind, port, ledger = sys.argv[1:]
    Recipient.ledger = Ledger(ledger)
    http.server.ThreadingHTTPServer.allow_reuse_address = True
    server = http.server.ThreadingHTTPServer(("127.0.0.1", int(port)), {"webhook": Webhook, "open311": Open311}[kind])
    threading.Thread(target=server.serve_forever, daemon=True).start()
    print("ready", flush=True)
    for line in sys.stdin:
        if line.startswith("close "):
            Recipient.closed.add(line.split()[1])
        else:
            Recipient.mode = line.strip()
        print("ok", flush=True)
    os._exit(0)


if __name__ == "__main__":
    main()
