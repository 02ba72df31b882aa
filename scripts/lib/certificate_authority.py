"""A zone's certificate authority: keys, certificates, the list of revoked ones, a register of all that was issued.

The register is written before a certificate leaves the authority, so whatever exists can be revoked.
"""

import contextlib
import datetime
import fcntl
import ipaddress
import json
import os
import re
import shutil
import tempfile

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.serialization import pkcs7
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from broker_files import ZONE_USER, Usage, require_id, sync_folder, write_private

REGISTER = "register.json"
FORMAT = 1
# The zone's own keys lie beside the authority's: a shorter life of theirs would protect nothing.
AUTHORITY_DAYS = 3650
# A clock that is a little behind must not find a new certificate "not yet valid".
BACKDATED = datetime.timedelta(hours=1)
HOST_PATTERN = re.compile(r"(?=.{1,253}\Z)[A-Za-z0-9]([A-Za-z0-9-]{0,62})(\.[A-Za-z0-9]([A-Za-z0-9-]{0,62}))*")
# As src/directory/signed_document.h has it.
DIRECTORY_SIGNER = "zone directory"
# By these names the zone's own bridge reaches a broker on the same machine.
OWN_HOSTS = ["127.0.0.1", "localhost"]


def now():
    return datetime.datetime.utcnow().replace(microsecond=0)


def require_host(text):
    """A name or address that a certificate can carry."""
    try:
        # A scope ("%eth0") means nothing to others, and Python lets any characters be one.
        return str(ipaddress.ip_address(text.replace("%", "?")))
    except ValueError:
        if not HOST_PATTERN.fullmatch(text):
            raise Usage(f"host {text!r} is not accepted, an IP address or host name is") from None
        return text


def common_name(name):
    return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, name)])


def alternative_names(hosts):
    def general_name(host):
        try:
            return x509.IPAddress(ipaddress.ip_address(host))
        except ValueError:
            return x509.DNSName(host)
    return x509.SubjectAlternativeName([general_name(host) for host in hosts])


def key_pem(key):
    return key.private_bytes(serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8,
                             serialization.NoEncryption())


def certificate_pem(certificate):
    return certificate.public_bytes(serialization.Encoding.PEM)


def key_usage(**wanted):
    names = ("digital_signature", "content_commitment", "key_encipherment", "data_encipherment",
             "key_agreement", "key_cert_sign", "crl_sign", "encipher_only", "decipher_only")
    return x509.KeyUsage(**{name: wanted.get(name, False) for name in names})


def make_root(zone):
    """A new authority: its key and the certificate that it signed itself."""
    key = ec.generate_private_key(ec.SECP256R1())
    name = common_name(f"LiveMap zone {zone}"[:64])
    certificate = (
        x509.CertificateBuilder().subject_name(name).issuer_name(name).public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now() - BACKDATED)
        .not_valid_after(now() + datetime.timedelta(days=AUTHORITY_DAYS))
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        .add_extension(key_usage(key_cert_sign=True, crl_sign=True), critical=True)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(key.public_key()), critical=False)
        .sign(key, hashes.SHA256()))
    return key, certificate


def public_bytes(key):
    return key.public_bytes(serialization.Encoding.DER, serialization.PublicFormat.SubjectPublicKeyInfo)


def fault_of(folder):
    """What is wrong with the folder of a key, its certificate and the authority's; None where they fit together."""
    path = folder
    try:
        loaded = []
        for name, load_one in (("key.pem", lambda data: serialization.load_pem_private_key(data, password=None)),
                               ("certificate.pem", x509.load_pem_x509_certificate),
                               ("ca.pem", x509.load_pem_x509_certificate)):
            path = os.path.join(folder, name)
            with open(path, "rb") as file:
                loaded.append(load_one(file.read()))
        key, certificate, authority = loaded
        path = os.path.join(folder, "certificate.pem")
        if public_bytes(key.public_key()) != public_bytes(certificate.public_key()):
            return f"'{path}' is not of the key beside it"
        if certificate.issuer != authority.subject:
            return f"'{path}' is not of the authority beside it"
    except OSError as error:
        return f"'{path}' cannot be read ({error.strerror})"
    except (ValueError, TypeError):
        return f"'{path}' is damaged"
    return None


class Authority:
    """The authority below `directory`; `open` and `create` hold its lock for as long as the `with` block."""

    def __init__(self, directory, register, key, certificate):
        self.directory, self.register = directory, register
        self.key, self.certificate = key, certificate

    def path(self, *parts):
        return os.path.join(self.directory, *parts)

    @classmethod
    @contextlib.contextmanager
    def create(cls, directory, zone):
        """A new authority for `zone`, or the one that is there already; Usage where something else is."""
        require_id(zone, "zone")
        if not os.path.exists(os.path.join(directory, REGISTER)) and other_files(directory):
            raise Usage(f"directory '{directory}' holds other files, accepted is a new or empty one or a zone's")
        os.makedirs(directory, mode=0o700, exist_ok=True)
        with locked(directory):
            if not os.path.exists(os.path.join(directory, REGISTER)):
                make_authority(directory, zone)
            authority = cls(directory, *load(directory))
            if authority.register["zone"] != zone:
                raise Usage(f"directory '{directory}' belongs to zone '{authority.register['zone']}', not to '{zone}'")
            yield authority

    @classmethod
    @contextlib.contextmanager
    def open(cls, directory):
        if not os.path.exists(os.path.join(directory, REGISTER)):
            raise Usage(f"directory '{directory}' holds no zone, ./livemap zone init makes one")
        with locked(directory):
            yield cls(directory, *load(directory))

    def save(self):
        write_private(self.path(REGISTER), json.dumps(self.register, indent=1) + "\n")

    def sign(self, name, public_key, life, purpose, hosts=()):
        builder = (
            x509.CertificateBuilder().subject_name(common_name(name)).issuer_name(self.certificate.subject)
            .public_key(public_key).serial_number(x509.random_serial_number())
            .not_valid_before(now() - BACKDATED)
            .not_valid_after(min(now() + life, self.certificate.not_valid_after))
            .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
            .add_extension(key_usage(digital_signature=True), critical=True)
            # A vehicle's certificate is no broker's, nor the other way round.
            .add_extension(x509.ExtendedKeyUsage([purpose]), critical=True)
            .add_extension(x509.AuthorityKeyIdentifier.from_issuer_public_key(self.key.public_key()),
                           critical=False))
        if hosts:
            builder = builder.add_extension(alternative_names(hosts), critical=False)
        return builder.sign(self.key, hashes.SHA256())

    def sign_directory(self, content, life):
        """The bytes with a signature around them (CMS SignedData, RFC 5652), by a key that is used once and forgotten."""
        key = ec.generate_private_key(ec.SECP256R1())
        certificate = self.sign(DIRECTORY_SIGNER, key.public_key(), life, ExtendedKeyUsageOID.EMAIL_PROTECTION)
        return (pkcs7.PKCS7SignatureBuilder().set_data(content).add_signer(certificate, key, hashes.SHA256())
                .sign(serialization.Encoding.DER, [pkcs7.PKCS7Options.Binary, pkcs7.PKCS7Options.NoCapabilities]))

    def issue_folder(self, folder, certificate_of):
        """Makes `folder` with a new key, its certificate and the authority's, all at once."""
        work = tempfile.mkdtemp(prefix=".new-", dir=self.directory)
        try:
            key = ec.generate_private_key(ec.SECP256R1())
            certificate = certificate_of(key.public_key())
            write_private(os.path.join(work, "key.pem"), key_pem(key))
            write_private(os.path.join(work, "certificate.pem"), certificate_pem(certificate))
            write_private(os.path.join(work, "ca.pem"), certificate_pem(self.certificate))
            shutil.rmtree(folder, ignore_errors=True)
            os.rename(work, folder)
            sync_folder(os.path.dirname(folder))
        finally:
            shutil.rmtree(work, ignore_errors=True)

    def issue_own(self, hosts):
        """The broker's folder (anew when its hosts changed) and that of the zone's own client."""
        life = datetime.timedelta(days=AUTHORITY_DAYS)
        if self.register.get("hosts") != hosts or fault_of(self.path("broker")):
            self.issue_folder(self.path("broker"), lambda key: self.sign(
                "broker", key, life, ExtendedKeyUsageOID.SERVER_AUTH, hosts))
            self.register["hosts"] = hosts
            self.save()
        if fault_of(self.path("zone")):
            self.issue_folder(self.path("zone"), lambda key: self.sign(
                ZONE_USER, key, life, ExtendedKeyUsageOID.CLIENT_AUTH))

    def valid_entry(self, vehicle):
        """The register's entry of the vehicle's certificate that is not revoked, or None."""
        return next((entry for entry in self.register["certificates"]
                     if entry["vehicle"] == vehicle and not entry["revoked"]), None)

    def known(self, vehicle):
        """Whether the vehicle ever had a certificate."""
        return any(entry["vehicle"] == vehicle for entry in self.register["certificates"])

    def revoked_vehicles(self):
        names = {entry["vehicle"] for entry in self.register["certificates"]}
        return sorted(name for name in names if not self.valid_entry(name))

    def enroll(self, vehicle, days):
        """Issues the vehicle's folder and returns its path."""
        folder = self.path("vehicles", vehicle)
        if self.valid_entry(vehicle):
            raise Usage(f"vehicle '{vehicle}' is enrolled already, its folder was made as {folder}; "
                        "revoke it first to give it a new key")

        def certificate_of(public_key):
            certificate = self.sign(vehicle, public_key, datetime.timedelta(days=days),
                                    ExtendedKeyUsageOID.CLIENT_AUTH)
            self.register["certificates"].append({
                "vehicle": vehicle, "serial": f"{certificate.serial_number:x}",
                "expires": certificate.not_valid_after.isoformat(), "revoked": None})
            self.save()
            return certificate

        os.makedirs(self.path("vehicles"), mode=0o700, exist_ok=True)
        self.issue_folder(folder, certificate_of)
        return folder

    def revoke(self, vehicle):
        """Puts all certificates of the vehicle on the list; False when they were there already."""
        entries = [entry for entry in self.register["certificates"] if entry["vehicle"] == vehicle]
        if not entries:
            raise Usage(f"vehicle '{vehicle}' was never enrolled in zone '{self.register['zone']}'")
        fresh = [entry for entry in entries if not entry["revoked"]]
        for entry in fresh:
            entry["revoked"] = now().isoformat()
        self.save()
        self.write_revoked()
        shutil.rmtree(self.path("vehicles", vehicle), ignore_errors=True)
        return bool(fresh)

    def write_revoked(self):
        """The list of revoked certificates, crl.pem.

        An old list would make the broker refuse everybody; ours never leaves this machine, so it cannot be outdated.
        """
        self.register["list_number"] += 1
        self.save()
        builder = (
            x509.CertificateRevocationListBuilder().issuer_name(self.certificate.subject)
            .last_update(now() - BACKDATED).next_update(self.certificate.not_valid_after)
            .add_extension(x509.CRLNumber(self.register["list_number"]), critical=False)
            .add_extension(x509.AuthorityKeyIdentifier.from_issuer_public_key(self.key.public_key()),
                           critical=False))
        for entry in self.register["certificates"]:
            if entry["revoked"]:
                builder = builder.add_revoked_certificate(
                    x509.RevokedCertificateBuilder().serial_number(int(entry["serial"], 16))
                    .revocation_date(datetime.datetime.fromisoformat(entry["revoked"])).build())
        write_private(self.path("crl.pem"), certificate_pem(builder.sign(self.key, hashes.SHA256())))


def other_files(directory):
    """What is in the folder besides the leftovers of an `init` that was cut short."""
    if not os.path.exists(directory):
        return []
    names = [name for name in os.listdir(directory) if name not in (".lock", "authority")]
    return [name for name in names if not name.startswith(".new-")]


@contextlib.contextmanager
def locked(directory):
    """Two commands at once would lose an entry of the register."""
    with open(os.path.join(directory, ".lock"), "w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield


def make_authority(directory, zone):
    """Writes the register last: without it there is no zone, and `init` begins anew."""
    key, certificate = make_root(zone)
    os.makedirs(os.path.join(directory, "authority"), mode=0o700, exist_ok=True)
    write_private(os.path.join(directory, "authority", "key.pem"), key_pem(key))
    write_private(os.path.join(directory, "authority", "ca.pem"), certificate_pem(certificate))
    register = {"format": FORMAT, "zone": zone, "hosts": None, "list_number": 0, "certificates": []}
    write_private(os.path.join(directory, REGISTER), json.dumps(register, indent=1) + "\n")


def load(directory):
    """The register, key and certificate on disk; Usage when they are damaged."""
    path = os.path.join(directory, REGISTER)
    try:
        with open(path, encoding="ascii") as file:
            register = json.load(file)
        if register["format"] != FORMAT:
            raise Usage(f"'{path}' has format {register['format']}, accepted is {FORMAT}")
        path = os.path.join(directory, "authority", "key.pem")
        with open(path, "rb") as file:
            key = serialization.load_pem_private_key(file.read(), password=None)
        path = os.path.join(directory, "authority", "ca.pem")
        with open(path, "rb") as file:
            certificate = x509.load_pem_x509_certificate(file.read())
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise Usage(f"'{path}' is damaged, restore it from a backup ({type(error).__name__})") from error
    return register, key, certificate
