"""A server between a client and a store, which keeps a record and does harm."""

import http.client
import re
import threading
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer


_PASSED_ON = ("Range", "If-Match")


@dataclass(frozen=True)
class Answer:
    """What the store answered, and how it will be sent.

    **Fields:** `sent_length`: bytes after which the connection is cut, None for all;
    `wait_s` before the body; `hold` is waited for at the cut.
    """

    status: int
    headers: dict[str, str]
    body: bytes
    sent_length: int | None = None
    wait_s: float = 0.0
    hold: threading.Event | None = None


@dataclass
class Request:
    """One request as it came; `range` is the first and the last byte."""

    method: str
    path: str
    range: tuple[int, int] | None

    @property
    def is_list(self) -> bool:
        return "list-type=2" in self.path

    @property
    def is_transfer(self) -> bool:
        """A request for the content of an object, indices included."""
        return self.method == "GET" and not self.is_list


Fault = Callable[[Request, Answer], Answer]


@dataclass
class Mischief:
    """The server. Each fault is applied to each answer, in turn.

    **Fields:** `url`; `requests`, all of them in their order; `page`, keys in a page
    of a listing, None for the store's own number.
    """

    store_port: int
    faults: list[Fault] = field(default_factory=list)
    requests: list[Request] = field(default_factory=list)
    page: int | None = None

    def __post_init__(self):
        mischief = self

        class Handler(_Handler):
            owner = mischief

        self._server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self._server.daemon_threads = True
        self.url = f"http://127.0.0.1:{self._server.server_port}"
        self._thread = threading.Thread(target=self._server.serve_forever, args=(0.02,))
        self._thread.start()

    def close(self) -> None:
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()

    @property
    def transfers(self) -> list[Request]:
        return [request for request in self.requests if request.is_transfer]

    def ask_store(self, request: Request, headers: dict[str, str]) -> Answer:
        path = request.path
        if request.is_list and self.page:
            path += f"&max-keys={self.page}"
        connection = http.client.HTTPConnection("127.0.0.1", self.store_port)
        try:
            connection.request(request.method, path, headers=headers)
            response = connection.getresponse()
            body = response.read()
            return Answer(response.status, dict(response.headers.items()), body)
        finally:
            connection.close()


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    owner: Mischief

    def do_GET(self):
        self._serve("GET")

    def do_HEAD(self):
        self._serve("HEAD")

    def log_message(self, format, *args):
        pass

    def _serve(self, method: str) -> None:
        wanted = re.fullmatch(r"bytes=(\d+)-(\d+)", self.headers.get("Range", ""))
        part = (int(wanted[1]), int(wanted[2])) if wanted else None
        request = Request(method, self.path, part)
        self.owner.requests.append(request)
        passed_on = {k: self.headers[k] for k in _PASSED_ON if k in self.headers}
        answer = self.owner.ask_store(request, passed_on)
        for fault in self.owner.faults:
            answer = fault(request, answer)
        self._send(method, answer)

    def _send(self, method: str, answer: Answer) -> None:
        self.send_response(answer.status)
        length = answer.headers.get("Content-Length", "0")
        dropped = {"connection", "content-length", "transfer-encoding", "date"}
        for name, value in answer.headers.items():
            if name.lower() not in dropped:
                self.send_header(name, value)
        body = answer.body if method == "GET" else b""
        self.send_header("Content-Length", str(len(body)) if body else length)
        self.end_headers()
        time.sleep(answer.wait_s)
        try:
            self.wfile.write(body[: answer.sent_length])
            self.wfile.flush()
            if answer.hold is not None:
                answer.hold.wait(20.0)
        except OSError:
            self.close_connection = True
        if answer.sent_length is not None:
            self.close_connection = True


def of_files(fault: Fault, times: int | None = None) -> Fault:
    """A fault of imagery and fields only, not of lists and indices; so many times each.

    Counted file by file: which of several transfers a server answers first is chance.
    """
    done = Counter[str]()
    lock = threading.Lock()

    def limited(request: Request, answer: Answer) -> Answer:
        if not request.is_transfer or request.path.endswith(".idx"):
            return answer
        with lock:
            done[request.path] += 1
            is_over = times is not None and done[request.path] > times
        return answer if is_over else fault(request, answer)

    return limited


def cut(after: int, hold: threading.Event | None = None) -> Fault:
    """The connection ends in the middle of a body."""
    return lambda request, answer: replace(answer, sent_length=after, hold=hold)


def shortened(request: Request, answer: Answer) -> Answer:
    """Half of what was asked for, in good order."""
    return replace(answer, body=answer.body[: len(answer.body) // 2 + 1])


def corrupted(request: Request, answer: Answer) -> Answer:
    """The last byte is another one."""
    return replace(answer, body=answer.body[:-1] + bytes([answer.body[-1] ^ 0xFF]))


def slow(seconds: float) -> Fault:
    """Nothing comes for a while."""
    return lambda request, answer: replace(answer, wait_s=seconds)


def busy(request: Request, answer: Answer) -> Answer:
    """What S3 says under load."""
    return Answer(503, {}, b"<Error><Code>SlowDown</Code></Error>")


def listed(edit: Callable[[str], str]) -> Fault:
    """Listings say something else."""

    def edited(request: Request, answer: Answer) -> Answer:
        if not request.is_list:
            return answer
        return replace(answer, body=edit(answer.body.decode()).encode())

    return edited
