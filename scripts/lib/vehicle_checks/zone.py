"""The zone as the vehicle reaches it: its own identity, and the broker."""

import datetime
import ipaddress
import os
import socket
import ssl
import stat
import time

from vehicle_checks.finding import Unreadable, fault, ok, read_file, unknown, warning

CONNECT_S, ANSWER_S = 4.0, 4.0
# How long a broker that refuses a certificate takes to say so, at most.
ALERT_S = 1.0
SOON_DAYS = 30
REFUSALS = {0x80: "unspecified error", 0x81: "malformed packet", 0x84: "it does not speak MQTT 5",
            0x85: "client id not valid", 0x86: "wrong user name or password", 0x87: "not authorised",
            0x88: "server unavailable", 0x89: "server busy", 0x8A: "banned", 0x8C: "bad authentication method",
            0x9F: "too many connections", 1: "it does not speak MQTT 5", 4: "wrong user name or password",
            5: "not authorised"}
ENROLL = "./livemap zone enroll VEHICLE on the zone's machine, then copy its folder (docs/how-to/enroll-a-vehicle.md)"


class Identity:
    """Paths of the three files; all empty: none."""

    def __init__(self, values):
        folder = values["identity"]
        names = (("ca_file", "ca.pem"), ("certificate_file", "certificate.pem"), ("key_file", "key.pem"))
        self.ca, self.certificate, self.key = (
            str(values.parameter("mqtt_bridge", parameter, default="") or "") or (folder and os.path.join(folder, file))
            for parameter, file in names)

    def __bool__(self):
        return bool(self.ca or self.certificate or self.key)

    def paths(self):
        return self.ca, self.certificate, self.key


def is_here(host):
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def identity(values):
    files = Identity(values)
    host = str(values.parameter("mqtt_bridge", "host", "broker_host"))
    if not files:
        return without_identity(values, host)
    for path in files.paths():
        if not path:
            return fault("ca_file, certificate_file and key_file are not all three given", "identity:= the vehicle's folder")
    try:
        ca, certificate, key = (read_file(path) for path in files.paths())
    except Unreadable as reason:
        return fault(str(reason), f"{ENROLL}; the files belong to the user who drives")
    try:
        from cryptography import x509
        from cryptography.hazmat.primitives import serialization
    except ImportError:
        return unknown("Python's cryptography is not installed", "sudo apt-get install python3-cryptography")
    try:
        own_key = serialization.load_pem_private_key(key, None)
    except (ValueError, TypeError):
        return fault(f"'{files.key}' is no key, or has a password", ENROLL)
    try:
        own, authority = x509.load_pem_x509_certificate(certificate), x509.load_pem_x509_certificate(ca)
        names = [str(entry.value) for entry in own.subject if entry.oid == x509.NameOID.COMMON_NAME]
    except ValueError:
        return fault(f"'{files.certificate}' or '{files.ca}' is no certificate", ENROLL)
    spki = serialization.Encoding.DER, serialization.PublicFormat.SubjectPublicKeyInfo
    if own.public_key().public_bytes(*spki) != own_key.public_key().public_bytes(*spki):
        return fault("the key is not that of the certificate", ENROLL)
    if not signed_by(own, authority):
        return fault("the certificate is not of the authority in ca.pem", ENROLL)
    return judged(own, names, str(values.parameter("mqtt_bridge", "user", "vehicle")), files.key)


def signed_by(certificate, authority):
    from cryptography.exceptions import InvalidSignature
    from cryptography.hazmat.primitives.asymmetric import ec, padding
    key, digest = authority.public_key(), certificate.signature_hash_algorithm
    how = {True: (ec.ECDSA(digest),), False: (padding.PKCS1v15(), digest)}[isinstance(key, ec.EllipticCurvePublicKey)]
    try:
        key.verify(certificate.signature, certificate.tbs_certificate_bytes, *how)
    except (InvalidSignature, TypeError, AttributeError):
        return False
    return certificate.issuer == authority.subject


def judged(certificate, names, vehicle, key_path):
    now = datetime.datetime.utcnow()
    days = (certificate.not_valid_after - now).total_seconds() / 86400
    figures = {"days_left": round(days, 1)}
    if days < 0:
        return fault(f"the certificate ended {-days:.0f} days ago", f"revoke and enroll the vehicle: {ENROLL}", **figures)
    if certificate.not_valid_before > now:
        return fault(f"the certificate is valid from {certificate.not_valid_before:%Y-%m-%d %H:%M} UTC, which is not yet",
                     "set this computer's clock", **figures)
    if names != [vehicle]:
        return fault(f"the certificate is for '{', '.join(names)}', and vehicle:= is '{vehicle}'",
                     "vehicle:= the name that was enrolled", **figures)
    found = f"'{vehicle}', {days:.0f} days left"
    if stat.S_IMODE(os.stat(key_path).st_mode) & 0o077:
        return warning(f"{found}; others of this computer may read the key", f"chmod 600 {key_path}", **figures)
    if days < SOON_DAYS:
        return warning(found, f"revoke and enroll the vehicle before it ends: {ENROLL}", **figures)
    return ok(found, **figures)


def without_identity(values, host):
    file = str(values.parameter("mqtt_bridge", "password_file", "password_file") or "")
    if file:
        try:
            if not read_file(file, 65536).splitlines()[:1]:
                return fault(f"'{file}' is empty", "password_file:= DIRECTORY/credentials/VEHICLE of ./livemap broker")
        except Unreadable as reason:
            return fault(str(reason), "password_file:= DIRECTORY/credentials/VEHICLE of ./livemap broker")
    what = "a password" if file else "none"
    if is_here(host):
        return ok(f"{what}, to a broker on this computer")
    return warning(f"{what}: whoever is on the way to '{host}' reads along", f"identity:= the vehicle's folder: {ENROLL}")


def mqtt_text(text):
    data = text.encode("utf-8", "replace")[:65535]
    return len(data).to_bytes(2, "big") + data


def mqtt_length(number):
    out = bytearray()
    while True:
        number, byte = divmod(number, 128)
        out.append(byte | (128 if number else 0))
        if not number:
            return bytes(out)


def connect_packet(user, password, expiry_s):
    """MQTT 5's CONNECT, which goes on with the vehicle's session: messages that wait for it stay."""
    flags = 0x80 | (0x40 if password is not None else 0)
    body = mqtt_text("MQTT") + bytes([5, flags, 0, 10, 5, 0x11]) + expiry_s.to_bytes(4, "big") + mqtt_text(user) + mqtt_text(user)
    body += mqtt_text(password) if password is not None else b""
    return b"\x10" + mqtt_length(len(body)) + body


def receive(connection, count, seconds):
    """Up to `count` bytes, until the peer ends or the time is over (socket.timeout)."""
    data, end = b"", time.monotonic() + seconds
    while len(data) < count:
        left = end - time.monotonic()
        if left <= 0:
            raise socket.timeout
        connection.settimeout(left)
        more = connection.recv(count - len(data))
        if not more:
            break
        data += more
    return data


def tls_context(files):
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.minimum_version = ssl.TLSVersion.TLSv1_3
    context.load_verify_locations(files.ca)
    context.load_cert_chain(files.certificate, files.key, password="")
    return context


def broker(values, vehicle_runs):
    """TCP, then TLS, then a login, unless the vehicle itself is logged in by this name: the second ends the first."""
    host, port = str(values.parameter("mqtt_bridge", "host", "broker_host")), values.port("mqtt_bridge", "broker_port")
    where = f"{host}:{port}"
    files = Identity(values)
    context = None
    if files:
        try:
            for path in files.paths():
                read_file(path)
            context = tls_context(files)
        except (Unreadable, OSError, ValueError):  # ssl.SSLError is an OSError.
            return unknown(f"{where} is not tried: the identity cannot be used", "mend the identity first")
    try:
        plain = socket.create_connection((host, port), CONNECT_S)
    except socket.gaierror:
        return fault(f"the name '{host}' is not known", "broker_host:= the zone's name; is there a network?")
    except socket.timeout:
        return fault(f"{where} does not answer", "is there a network, and does the zone's firewall let this port through?")
    except (OSError, UnicodeError) as error:
        return fault(f"{where}: {getattr(error, 'strerror', None) or error}",
                     "start the zone's broker, or set broker_host:= and broker_port:=")
    with plain:
        return speak(plain, context, values, where, host, vehicle_runs)


def speak(plain, context, values, where, host, vehicle_runs):
    connection = plain
    if context:
        try:
            plain.settimeout(ANSWER_S)
            connection = context.wrap_socket(plain, server_hostname=host)
        except ssl.SSLCertVerificationError as error:
            return fault(f"this vehicle refuses the certificate of {where}: {error.verify_message}",
                         "set the clock, take the zone's own ca.pem, and name the broker as livemap zone init --host did")
        except socket.timeout:
            return fault(f"{where} accepts connections and says nothing", "is a broker of LiveMap at this port? restart it")
        except OSError as error:
            return refused(where, error)
    with connection:
        try:
            if context:
                wait_for_refusal(connection)
            if vehicle_runs:
                return ok(f"{where} answers{' and takes the certificate' if context else ''}; the running vehicle is logged in")
            return log_in(connection, values, where)
        except socket.timeout:
            return fault(f"{where} accepts connections and says nothing", "is a broker of LiveMap at this port? restart it")
        except OSError as error:
            return refused(where, error)


def refused(where, error):
    reason = str(getattr(error, "reason", None) or "")
    if "ALERT" in reason or "alert" in reason:
        words = reason.lower().replace("_", " ").split("alert ")[-1]
        return fault(f"{where} refuses this vehicle's certificate: {words}", f"revoked, ended or of another zone: {ENROLL}")
    if "WRONG_VERSION" in reason or "NOT_A" in reason or "UNEXPECTED_EOF" in reason:
        return fault(f"{where} speaks no TLS", "broker_port:= the port with certificates (8883), or no identity:=")
    return fault(f"{where} refuses the connection: {reason or getattr(error, 'strerror', None) or error}",
                 "see the broker's log; a revoked certificate ends like this, and a port that wants one")


def wait_for_refusal(connection):
    """A broker refuses a certificate in TLS 1.3 after the handshake, or says nothing: OSError where it refuses.

    What is sent too early meets a closed connection, and its reason is lost.
    """
    try:
        if receive(connection, 1, ALERT_S) == b"":
            raise OSError("it ended the connection where it looks at the vehicle's certificate")
    except socket.timeout:
        pass


def log_in(connection, values, where):
    user = str(values.parameter("mqtt_bridge", "user", "vehicle"))
    file = str(values.parameter("mqtt_bridge", "password_file", "password_file") or "")
    password = None
    if file:
        try:
            password = (read_file(file, 65536).decode("utf-8", "replace").splitlines() or [""])[0]
        except Unreadable:
            return unknown(f"{where} answers; without the password no login is tried", "mend the identity first")
    expiry_s = values.parameter("mqtt_bridge", "session_expiry_s", default=600)
    connection.settimeout(ANSWER_S)
    began = time.monotonic()
    connection.sendall(connect_packet(user, password, expiry_s if isinstance(expiry_s, int) and 0 <= expiry_s < 1 << 32 else 600))
    answer = receive(connection, 4, ANSWER_S)
    took_ms = round(1000 * (time.monotonic() - began), 1)
    if answer == b"":
        return refused(where, OSError("without a word"))
    if len(answer) < 4 or answer[0] != 0x20:
        return fault(f"what listens at {where} is no MQTT broker", "broker_port:= the broker's port")
    if answer[3] != 0:
        words = REFUSALS.get(answer[3], f"MQTT reason {answer[3]}")
        return fault(f"{where} refuses '{user}': {words}", "password_file:= or identity:= of this vehicle, and its name in vehicle:=")
    connection.sendall(b"\xe0\x00")
    return ok(f"{where} lets '{user}' in, {took_ms:.0f} ms", answer_ms=took_ms)
