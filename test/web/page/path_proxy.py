"""A reverse proxy that serves another server below a path of its own host, as nginx does with

  location /livemap/ { proxy_pass http://127.0.0.1:8080/; }

and `Host` and WebSockets passed on. Everything outside that path is answered 404."""

import contextlib
import socket
import socketserver
import threading

MAX_HEAD_BYTES = 65536


class PathProxy:
    """`with PathProxy(port, "/livemap/") as proxy:` serves 127.0.0.1:port at proxy.url."""

    def __init__(self, port, prefix):
        self.upstream, self.prefix = ("127.0.0.1", port), prefix
        self.outside = []  # Request lines that were not below the prefix.
        self.held = None  # The HeldAnswer that is waited for.
        self.limited = None  # Requests whose line has this part are answered 503, as limit_req does.
        self.server = _Server(("127.0.0.1", 0), _Connection)
        self.server.proxy = self
        self.url = f"http://127.0.0.1:{self.server.server_address[1]}{prefix}"

    def hold(self, part):
        """From now on answers to requests whose line has this part are held."""
        self.held = HeldAnswer(part.encode())
        return self.held

    def __enter__(self):
        threading.Thread(target=self.server.serve_forever, daemon=True).start()
        return self

    def __exit__(self, *_):
        self.server.shutdown()
        self.server.server_close()


class HeldAnswer:
    """An answer that the server has `made`, and that the browser gets when the test says `go`."""

    def __init__(self, part):
        self.part, self.made, self.go = part, threading.Event(), threading.Event()


class _Server(socketserver.ThreadingTCPServer):
    daemon_threads = True
    block_on_close = False


class _Connection(socketserver.BaseRequestHandler):
    """One request each, unless it opens a WebSocket."""

    def handle(self):
        proxy = self.server.proxy
        with contextlib.suppress(OSError):
            head, _, rest = self.read_head().partition(b"\r\n\r\n")
            lines = head.split(b"\r\n")
            method, _, target = lines[0].partition(b" ")
            prefix = proxy.prefix.encode()
            if not target.startswith(prefix):
                if target:
                    proxy.outside.append(lines[0].decode("latin-1"))
                    self.request.sendall(b"HTTP/1.1 404 Not Found\r\nContent-Length: 0\r\nConnection: close\r\n\r\n")
                return
            if proxy.limited and proxy.limited.encode() in target:
                self.request.sendall(
                    b"HTTP/1.1 503 Service Unavailable\r\nContent-Length: 0\r\nConnection: close\r\n\r\n")
                return
            lines[0] = method + b" /" + target[len(prefix):]
            if not any(line.lower().startswith(b"upgrade:") for line in lines):
                lines = [line for line in lines if not line.lower().startswith(b"connection:")] + [b"Connection: close"]
            with socket.create_connection(proxy.upstream) as upstream:
                upstream.sendall(b"\r\n".join(lines) + b"\r\n\r\n" + rest)
                if proxy.held and proxy.held.part in lines[0]:
                    answer = b"".join(iter(lambda: upstream.recv(65536), b""))
                    proxy.held.made.set()
                    proxy.held.go.wait()
                    self.request.sendall(answer)
                    return
                threading.Thread(target=_copy, args=(self.request, upstream), daemon=True).start()
                _copy(upstream, self.request)

    def read_head(self):
        data = b""
        while b"\r\n\r\n" not in data and len(data) < MAX_HEAD_BYTES:
            part = self.request.recv(4096)
            if not part:
                break
            data += part
        return data


def _copy(source, sink):
    with contextlib.suppress(OSError):
        while data := source.recv(65536):
            sink.sendall(data)
    with contextlib.suppress(OSError):
        sink.shutdown(socket.SHUT_WR)
