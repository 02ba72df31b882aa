"""A server of PostgreSQL for tests: its data in a folder of its own, reached by a socket in it alone."""

import os
import pathlib
import pwd
import shutil
import signal
import subprocess
import tempfile
import time


def programs():
    """The folder of the newest version's programs; None without a server."""
    folders = [path.parent for path in pathlib.Path("/usr/lib/postgresql").glob("*/bin/postgres")]
    return max(folders, key=lambda folder: float(folder.parent.name), default=None)


def as_somebody():
    """PostgreSQL refuses to run as root."""
    command = ["setpriv", "--pdeathsig", "QUIT"]
    if os.geteuid() != 0:
        return None, [*command, "--"]
    names = {entry.pw_name: entry for entry in pwd.getpwall()}
    user = names.get("postgres") or names["nobody"]
    return user, [*command, "--reuid", str(user.pw_uid), "--regid", str(user.pw_gid), "--clear-groups", "--"]


def roomy_folder():
    """In memory where that has room: a database that is dropped waits until all is on disk. None: the usual one."""
    memory = "/dev/shm"
    has_room = os.access(memory, os.W_OK) and shutil.disk_usage(memory).free >= 1 << 30
    return memory if has_room else None


class PostgresqlServer:
    """Runs from its beginning to close(); ends with the process, too."""

    def __init__(self):
        self.folder = tempfile.mkdtemp(prefix="livemap_postgresql_", dir=roomy_folder())
        user, self.begin = as_somebody()
        if user is not None:
            os.chown(self.folder, user.pw_uid, user.pw_gid)
        os.chmod(self.folder, 0o755)
        subprocess.run([*self.begin, programs() / "initdb", "-D", f"{self.folder}/data", "-U", "livemap", "-A", "trust", "-E", "UTF8",
                        "--locale=C.UTF-8", "-N"], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, cwd="/")
        self.process = None
        self.start()

    def start(self):
        with open(f"{self.folder}/server.log", "ab") as log:
            for _ in range(600):
                # It ends at once while processes of a killed one are attached to their common memory.
                if self.process is None or self.process.poll() is not None:
                    self.process = subprocess.Popen(
                        [*self.begin, programs() / "postgres", "-D", f"{self.folder}/data", "-k", self.folder,
                         "-c", "listen_addresses=", "-c", "shared_buffers=32MB"], stdout=log, stderr=log, cwd="/")
                if self.is_ready():
                    return
                time.sleep(0.1)
        raise RuntimeError(pathlib.Path(self.folder, "server.log").read_text())

    def is_ready(self):
        return subprocess.run([programs() / "pg_isready", "-q", "-h", self.folder], check=False).returncode == 0

    def kill(self, how=signal.SIGKILL):
        self.process.send_signal(how)
        self.process.wait()

    def close(self):
        if self.process.poll() is None:
            self.kill(signal.SIGQUIT)
        shutil.rmtree(self.folder, ignore_errors=True)

    def url(self, database):
        return f"postgresql://livemap@/{database}?host={self.folder}"

    def ask(self, database, sql):
        return subprocess.run([programs() / "psql", "-XAtq", "-v", "ON_ERROR_STOP=1", "-d", self.url(database), "-c", sql],
                              check=True, capture_output=True, text=True).stdout.strip()

    def make_database(self, name):
        self.ask("postgres", f"CREATE DATABASE {name}")
        return self.url(name)
