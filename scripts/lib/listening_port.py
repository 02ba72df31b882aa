"""Whether a program can listen on an address and port, who does where it cannot, and ports that are free."""

import errno
import fcntl
import os
import pathlib
import random
import socket
import tempfile

# Below the ports that Linux draws for connections and for servers that ask for any (ip_local_port_range).
FREE_PORTS = range(20000, 32000)
# Files of the ports that free_port gave out, locked while this process lives.
_locks = []


def why_not(address, port):
    """None where a program of this user can listen there; else why not, in one sentence without its full stop."""
    try:
        found = socket.getaddrinfo(address, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
    except (socket.gaierror, UnicodeError) as error:
        return f"address '{address}' is not accepted, an IP address or name of this machine is ({error})"
    for family, kind, protocol, _, where in found:
        with socket.socket(family, kind, protocol) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                probe.bind(where)
                probe.listen(1)
            except OSError as error:
                return sentence(address, port, error)
    return None


def free_port():
    """A port of 127.0.0.1 for a server that is started later; OSError where all are taken.

    Until this process ends, no other one is given it here, and the system draws it for no connection: what asks for
    port 0 and closes it again has neither.
    """
    folder = pathlib.Path(tempfile.gettempdir()) / f"livemap_ports_{os.getuid()}"
    folder.mkdir(mode=0o700, exist_ok=True)
    # Apart from the seeds of whoever asks.
    for port in random.SystemRandom().sample(FREE_PORTS, len(FREE_PORTS)):
        lock = open(folder / str(port), "w", encoding="ascii")
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            lock.close()
            continue
        if why_not("127.0.0.1", port) is None:
            _locks.append(lock)
            return port
        lock.close()
    raise OSError(errno.EADDRINUSE, f"all ports from {FREE_PORTS[0]} to {FREE_PORTS[-1]} of 127.0.0.1 are in use")


def sentence(address, port, error):
    if error.errno == errno.EADDRINUSE:
        return (f"port {port} of {address} is in use already by {holder(port) or 'a program of another user'}: "
                f"end it or choose another port (ss -ltnp 'sport = :{port}' shows who listens)")
    if error.errno == errno.EADDRNOTAVAIL:
        return f"address '{address}' is not one of this machine (ip address lists them), so port {port} cannot be opened"
    if error.errno == errno.EACCES:
        return f"port {port} of {address} is for root alone, accepted is 1024 to 65535"
    return f"port {port} of {address} cannot be opened: {error.strerror}"


def holder(port):
    """The program that listens on the port, as "mosquitto (process 123)"; None where nobody may be seen."""
    sockets = {f"socket:[{inode}]" for inode in listening_inodes(port)}
    for pid in filter(str.isdigit, os.listdir("/proc")):
        try:
            links = {os.readlink(entry.path) for entry in os.scandir(f"/proc/{pid}/fd")}
            if links & sockets:
                with open(f"/proc/{pid}/comm", encoding="utf-8", errors="replace") as file:
                    return f"{file.read().strip()} (process {pid})"
        except OSError:
            continue  # Another user's, or gone.
    return None


def listening_inodes(port):
    for table in ("/proc/net/tcp", "/proc/net/tcp6"):
        try:
            with open(table, encoding="ascii") as file:
                rows = [line.split() for line in file.readlines()[1:]]
        except OSError:
            continue
        for row in rows:
            if row[3] == "0A" and int(row[1].rpartition(":")[2], 16) == port:
                yield row[9]
