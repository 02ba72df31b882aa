"""An MQTT client that does what it is told, also what no honest library would send, and tells the broker's answers."""

import collections
import os
import socket
import ssl
import struct

PATIENCE_S = 60  # Only keeps a broken test from hanging.
CONNACK, PUBLISH, PUBACK, SUBACK, DISCONNECT = 2, 3, 4, 9, 14
ACCEPTED = (0, 16)  # 16: and nobody listens.
NOT_AUTHORIZED, RETAIN_NOT_SUPPORTED, PACKET_TOO_LARGE = 135, 154, 149

Message = collections.namedtuple("Message", "topic payload")
Will = collections.namedtuple("Will", "topic payload")


class Refused(Exception):
    """The connection was refused or ended; the text is all that the sender is told."""


def text(value):
    data = value.encode() if isinstance(value, str) else value
    return struct.pack(">H", len(data)) + data


def length(number):
    """MQTT's variable byte integer."""
    out = bytearray()
    while True:
        number, byte = divmod(number, 128)
        out.append(byte | (128 if number else 0))
        if not number:
            return bytes(out)


def tls_context(identity, authority=None, version=ssl.TLSVersion.TLSv1_3, certificate=True):
    """`identity`: a folder as `livemap zone enroll` makes it; `authority`: the file to trust, its own else."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.minimum_version = context.maximum_version = version
    context.load_verify_locations(authority or os.path.join(identity, "ca.pem"))
    if certificate:
        context.load_cert_chain(os.path.join(identity, "certificate.pem"), os.path.join(identity, "key.pem"))
    return context


class Sender:
    """One connection; every method waits for the broker's answer and raises Refused when there is none."""

    def __init__(self, port, context, client_id="", version=5, will=None, resume=None, keep_session=False, wait=None):
        """`wait` is called between the TLS handshake and the login."""
        self.version, self.packet_id, self.messages = version, 0, collections.deque()
        self.buffer = b""
        plain = socket.create_connection(("127.0.0.1", port), PATIENCE_S)
        try:
            self.connection = plain
            if context:
                self.connection = context.wrap_socket(plain, server_hostname="127.0.0.1", session=resume)
            if wait:
                wait()
            self.acceptance = self.request(0x10, self.connect_body(client_id, will, keep_session), CONNACK)
            if self.acceptance[1]:
                raise Refused(f"MQTT reason {self.acceptance[1]}")
        except OSError as error:
            plain.close()
            raise Refused(self.words(error)) from error
        except Refused:
            self.close()
            raise

    @staticmethod
    def words(error):
        return getattr(error, "reason", None) or error.strerror or str(error)

    def connect_body(self, client_id, will, keep_session):
        flags = (0 if keep_session else 2) | (0x0c if will else 0)  # A will goes out with QoS 1.
        body = text("MQTT") + bytes([self.version, flags, 0, 60])
        expiry = b"\x11" + struct.pack(">I", 600) if keep_session else b""
        body += (length(len(expiry)) + expiry if self.version == 5 else b"") + text(client_id)
        if will:
            body += (b"\0" if self.version == 5 else b"") + text(will.topic) + text(will.payload)
        return body

    def send(self, head, body):
        self.connection.sendall(bytes([head]) + length(len(body)) + body)

    def request(self, head, body, answer):
        """Sends a packet and returns the body of its answer."""
        try:
            self.send(head, body)
        except OSError:
            pass  # The broker closed already: what it said before is still to be read.
        while True:
            kind, found = self.read_packet()
            if kind == answer:
                return found

    def read_packet(self):
        """The next packet's kind and body; messages are put aside, the broker's goodbye is raised."""
        kind = self.read(1)[0]
        size, shift = 0, 0
        while True:
            byte = self.read(1)[0]
            size |= (byte & 127) << shift
            shift += 7
            if byte < 128:
                break
        body = self.read(size)
        if kind >> 4 == DISCONNECT:
            raise Refused(f"MQTT reason {body[0] if body else 0}")
        if kind >> 4 == PUBLISH:
            self.take_message(kind, body)
        return kind >> 4, body

    def take_message(self, kind, body):
        end = 2 + struct.unpack(">H", body[:2])[0]
        topic, rest = body[2:end].decode(), body[end:]
        if kind & 6:
            packet_id, rest = rest[:2], rest[2:]
            self.send(0x40, packet_id)
        if self.version == 5:
            rest = rest[1 + rest[0]:]
        self.messages.append(Message(topic, rest))

    def read(self, count):
        while len(self.buffer) < count:
            try:
                data = self.connection.recv(65536)
            except OSError as error:
                raise Refused(self.words(error)) from error
            if not data:
                raise Refused("connection closed")
            self.buffer += data
        data, self.buffer = self.buffer[:count], self.buffer[count:]
        return data

    def next_id(self):
        self.packet_id += 1
        return struct.pack(">H", self.packet_id)

    def publish(self, topic, payload, retain=False):
        """With QoS 1; the reason code of the answer (MQTT 3.1.1 has none: 0)."""
        body = text(topic) + self.next_id() + (b"\0" if self.version == 5 else b"") + payload
        answer = self.request(0x32 | retain, body, PUBACK)
        return answer[2] if len(answer) > 2 else 0

    def subscribe(self, topic_filter):
        """The reason code of the answer: 1 is granted with QoS 1."""
        body = self.next_id() + (b"\0" if self.version == 5 else b"") + text(topic_filter) + b"\1"
        return self.request(0x82, body, SUBACK)[-1]

    def receive(self):
        """The next message."""
        while not self.messages:
            self.read_packet()
        return self.messages.popleft()

    def ended(self):
        """Waits for the broker to end the connection and returns its words."""
        try:
            while True:
                self.read_packet()
        except Refused as reason:
            return str(reason)

    def close(self):
        """Goes without a word: a will is sent."""
        self.connection.close()

    def disconnect(self):
        self.send(0xE0, b"")
        self.close()
