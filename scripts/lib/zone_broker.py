"""The mosquitto of a zone with certificates: its configuration and rights, and how a running one learns of changes."""

import datetime
import os
import signal
import socket
import ssl
import tempfile

from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID

from broker_files import ZONE_USER, Usage, limits, log_and_user, vehicle_rights, write_private
from certificate_authority import certificate_pem, key_pem

BROKER_TIMEOUT_S = 10


def rights(zone, revoked):
    """The same for every vehicle, so that enrolling one changes nothing here. mosquitto warns at start that one
    pattern has no %u: it is meant so.

    Revoked vehicles lose their rights as well: mosquitto looks at a certificate when TLS begins, so a connection that
    was opened before the revocation can log in after it.
    """
    prefix = f"livemap/v1/{zone}"
    denied = [line for vehicle in revoked for line in (f"user {vehicle}", "topic deny #", "")]
    return "\n".join([
        f"user {ZONE_USER}",
        f"topic read {prefix}/vehicle/+/report",
        f"topic read {prefix}/vehicle/+/position",
        f"topic read {prefix}/vehicle/+/answer",
        f"topic read {prefix}/vehicle/+/candidate",
        f"topic read {prefix}/vehicle/+/change",
        f"topic write {prefix}/vehicle/+/receipt",
        f"topic write {prefix}/vehicle/+/change_receipt",
        f"topic read {prefix}/vehicle/+/cell_request",
        f"topic write {prefix}/vehicle/+/notice",
        f"topic write {prefix}/vehicle/+/cell_hazards",
        f"topic write {prefix}/vehicle/+/poll",
        f"topic write {prefix}/vehicle/+/directory",
        f"topic write {prefix}/notice",
        f"topic write {prefix}/notice/+",
        "",
        *denied,
        *vehicle_rights(zone),
        f"pattern read {prefix}/notice",
        f"pattern read {prefix}/notice/+",
        "",
    ])


def configuration(directory, address, port, max_message_bytes):
    return "\n".join([
        f"listener {port} {address}",
        "# Nobody without a certificate of this zone; its common name is who the client is.",
        "tls_version tlsv1.3",
        f"cafile {directory}/broker/ca.pem",
        f"certfile {directory}/broker/certificate.pem",
        f"keyfile {directory}/broker/key.pem",
        "require_certificate true",
        f"crlfile {directory}/crl.pem",
        "use_identity_as_username true",
        "allow_anonymous false",
        f"acl_file {directory}/acl",
        "# No client can take over another's session.",
        "use_username_as_clientid true",
        *limits(max_message_bytes),
        "# Sessions and queued messages survive an orderly restart; a report is safe only when the",
        "# zone has sent its receipt. Saving every change would not make the PUBACK a promise either:",
        "# it goes out before the change is saved.",
        "persistence true",
        f"persistence_location {directory}/data/",
        "autosave_interval 30",
        "persistent_client_expiration 1d",
        "# By this file `livemap zone revoke` finds the broker.",
        f"pid_file {directory}/mosquitto.pid",
        *log_and_user(),
    ]) + "\n"


def write_rights(authority):
    write_private(authority.path("acl"), rights(authority.register["zone"], authority.revoked_vehicles()))


def write_configuration(authority, address, port, max_message_bytes):
    """Writes what mosquitto reads and returns the path of its configuration."""
    directory = authority.directory
    authority.register.update(address=address, port=port)
    authority.save()
    os.makedirs(os.path.join(directory, "data"), mode=0o700, exist_ok=True)
    write_rights(authority)
    path = os.path.join(directory, "mosquitto.conf")
    write_private(path, configuration(directory, address, port, max_message_bytes))
    return path


def running_broker(directory):
    """The process id of the broker that runs with this folder, or None."""
    try:
        with open(os.path.join(directory, "mosquitto.pid"), encoding="ascii") as file:
            pid = int(file.read())
        with open(f"/proc/{pid}/comm", encoding="ascii") as file:
            # A killed broker leaves its file behind, and the number may be another program's by now.
            return pid if file.read().strip() == "mosquitto" else None
    except (OSError, ValueError):
        return None


def reload(pid):
    """mosquitto reads rights, certificates and the list of revoked ones again at SIGHUP."""
    try:
        os.kill(pid, signal.SIGHUP)
    except OSError as error:
        raise Usage(f"the running broker (process {pid}) could not be told: {error.strerror}; "
                    f"run as its user: kill -HUP {pid}") from error


def tell_broker(authority, vehicle):
    """Makes a running broker know who is revoked, and ends the connection under this vehicle's name; returns the
    broker's process id, None where none runs."""
    write_rights(authority)
    pid = running_broker(authority.directory)
    if pid:
        reload(pid)
        end_session(authority, vehicle)
    return pid


def connect_packet(client_id):
    """MQTT v5 CONNECT: clean start, no session afterwards, keepalive of 60 s."""
    body = b"\0\4MQTT\5\2\0\x3c\0" + len(client_id).to_bytes(2, "big") + client_id.encode("ascii")
    return bytes([0x10, len(body)]) + body


def end_session(authority, vehicle):
    """Throws a connected vehicle out of the running broker, with all that the broker keeps for it.

    mosquitto checks certificates only when TLS begins. But a second login of the same name ends the
    first: so the zone logs in once with the vehicle's name, by a certificate that exists for this moment.
    The broker takes this login after it read the new list: it handles the signal before the next connection's data.
    """
    key = ec.generate_private_key(ec.SECP256R1())
    certificate = authority.sign(vehicle, key.public_key(), datetime.timedelta(minutes=5),
                                 ExtendedKeyUsageOID.CLIENT_AUTH)
    register = authority.register
    host = {"0.0.0.0": "127.0.0.1", "::": "::1"}.get(register["address"], register["address"])
    try:
        context = ssl.create_default_context(cafile=authority.path("broker", "ca.pem"))
        context.minimum_version = ssl.TLSVersion.TLSv1_3
        context.check_hostname = False  # The listener's own address; the certificate is checked.
        with tempfile.TemporaryDirectory(prefix=".new-", dir=authority.directory) as work:
            own = os.path.join(work, "client.pem")
            write_private(own, key_pem(key) + certificate_pem(certificate))
            context.load_cert_chain(own)
        with socket.create_connection((host, register["port"]), BROKER_TIMEOUT_S) as plain, \
                context.wrap_socket(plain) as connection:
            connection.sendall(connect_packet(vehicle))
            answer = connection.recv(4)
            if len(answer) < 4 or answer[0] != 0x20 or answer[3] != 0:
                raise OSError(f"it answered {answer.hex() or 'nothing'}")
            connection.sendall(b"\xe0\0")
    except OSError as error:
        raise Usage(f"the running broker knows of the change, but a connection that vehicle '{vehicle}' has now could "
                    f"not be ended ({error}): restart the broker") from error
