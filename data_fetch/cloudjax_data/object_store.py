"""obstore reaches buckets: anonymous, read only, with one policy of retries."""

import random
import re
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from datetime import timedelta
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar, cast
from urllib.parse import unquote, urlsplit

import obstore
from obstore.exceptions import (
    BaseError,
    NotFoundError,
    PermissionDeniedError,
    PreconditionError,
)
from obstore.store import LocalStore, ObjectStore, S3Store

from .errors import DataError


if TYPE_CHECKING:
    from obstore import GetOptions

REGION = "us-east-1"
# What a broken connection loses at most.
_CHUNK = 2**17
_LONGEST_WAIT_S = 30.0
_FINAL = (NotFoundError, FileNotFoundError, PermissionDeniedError, PreconditionError)
# The client's fault, but for time-outs and too many requests.
_FINAL_STATUS = re.compile(r"status code: 4(?!08|29)\d\d")

T = TypeVar("T")


@dataclass(frozen=True)
class Link:
    """A `Link` says how to reach the buckets.

    **Fields:**

    - `endpoint`: URL of an S3-compatible store that has buckets of NOAA's names, or a
        folder that has a subfolder of that name for each; None for NOAA's own on AWS.
    - `timeout_s`: silence after which a connection counts as broken.
    - `retries`: tries more, in a row and without progress.
    - `first_wait_s`: before the first of them; each later one waits twice as long.
    - `connections`: files at once.
    """

    endpoint: str | None = None
    timeout_s: float = 30.0
    retries: int = 5
    first_wait_s: float = 0.5
    connections: int = 4

    def bucket(self, name: str) -> "Bucket":
        """Return a bucket; nothing is asked yet.

        **Raises:** `DataError` if the endpoint is neither a URL nor a folder.
        """
        if self.endpoint is None:
            url = f"https://{name}.s3.{REGION}.amazonaws.com"
            return Bucket(name, url, self, self._s3(name, url, virtual_hosted=True))
        parts = urlsplit(self.endpoint)
        if parts.scheme in ("http", "https"):
            endpoint = self.endpoint.rstrip("/")
            store = self._s3(name, endpoint, virtual_hosted=False)
            return Bucket(name, f"{endpoint}/{name}", self, store)
        is_url = parts.scheme == "file"
        folder = Path(unquote(parts.path) if is_url else self.endpoint) / name
        if not folder.is_dir():
            raise DataError(
                f"{folder} is not a folder: give as endpoint the URL of an "
                "S3-compatible store, or a folder with a subfolder for each bucket; "
                "nothing was written."
            )
        folder = folder.absolute()
        return Bucket(name, folder.as_uri(), self, LocalStore(prefix=folder))

    def _s3(self, name: str, endpoint: str, *, virtual_hosted: bool) -> S3Store:
        return S3Store(
            name,
            endpoint=endpoint,
            region=REGION,
            skip_signature=True,
            # Not used, but variables of the environment would be, and be found amiss.
            aws_endpoint_url_s3=endpoint,
            access_key_id="anonymous",
            secret_access_key="anonymous",
            virtual_hosted_style_request=virtual_hosted,
            client_options={
                "allow_http": endpoint.startswith("http:"),
                "connect_timeout": timedelta(seconds=self.timeout_s),
                "read_timeout": timedelta(seconds=self.timeout_s),
                # Of a whole answer; large files take what they take.
                "timeout": timedelta(days=1),
            },
            # Retries are made here, where it is known what has arrived.
            retry_config={"max_retries": 0, "retry_timeout": timedelta(0)},
        )


@dataclass(frozen=True)
class Listed:
    """A `Listed` is an object as the store lists it; `etag` is as it came, quotes
    included.
    """

    key: str
    size: int
    etag: str | None


@dataclass(frozen=True)
class Bucket:
    """A `Bucket` answers what is asked of it.

    **Fields:** `name`; `origin`, its address; `link`; `store`, of obstore.

    Methods raise `DataError` in one sentence once the retries of the link are spent,
    and `FileNotFoundError` for what the bucket does not hold.
    """

    name: str
    origin: str
    link: Link
    store: ObjectStore = field(repr=False)

    def list(self, folder: str) -> list[Listed]:
        """List all objects under a folder, page after page."""

        def pages() -> list[Listed]:
            found = obstore.list(self.store, folder, chunk_size=1000)
            return [
                Listed(str(meta["path"]), int(meta["size"]), meta["e_tag"])
                for page in found
                for meta in page
            ]

        return self._asked("list", folder, pages)

    def head(self, key: str) -> Listed:
        """Return size and tag of one object."""
        meta = self._asked("find", key, lambda: obstore.head(self.store, key))
        return Listed(key, int(meta["size"]), meta["e_tag"])

    def read(self, key: str, at_most: int) -> bytes:
        """Read a small object whole.

        **Raises:** `DataError` also if it is larger than it should be.
        """

        def body() -> bytes:
            answer = obstore.get(self.store, key)
            if answer.meta["size"] > at_most:
                raise DataError(
                    f"{self.origin}/{key} has {answer.meta['size']} bytes where at "
                    f"most {at_most} make sense: use another endpoint; nothing was "
                    "written."
                )
            return bytes(answer.bytes())

        return self._asked("read", key, body)

    def stream(
        self, key: str, start: int, end: int, etag: str | None
    ) -> Iterator[bytes]:
        """Yield the bytes from `start` to before `end` of the object of that tag.

        Tries once, and raises what obstore raises.
        """
        part = {"range": (start, end), "if_match": etag}
        answer = obstore.get(self.store, key, options=cast("GetOptions", part))
        yield from answer.stream(min_chunk_size=_CHUNK)

    def _asked(self, verb: str, what: str, ask: Callable[[], T]) -> T:
        retry = Retry(self.link)
        while True:
            try:
                return ask()
            except (NotFoundError, FileNotFoundError) as error:
                raise FileNotFoundError(f"{self.origin}/{what}") from error
            except (BaseError, OSError) as error:
                if is_final(error) or not retry.wait():
                    raise DataError(
                        f"{self.origin} would not {verb} {what} ({reason(error)}): "
                        "try again later or use another endpoint; nothing was written."
                    ) from error


class Retry:
    """A `Retry` backs off exponentially with jitter, by the policy of a link."""

    def __init__(self, link: Link, stop: threading.Event | None = None):
        self._link = link
        self._stop = stop
        self._failures = 0

    def progressed(self) -> None:
        """Start counting anew."""
        self._failures = 0

    def wait(self) -> bool:
        """Wait before the next try, or return False if there is none to be made."""
        if self._failures >= self._link.retries:
            return False
        longest = min(self._link.first_wait_s * 2**self._failures, _LONGEST_WAIT_S)
        self._failures += 1
        seconds = longest * random.uniform(0.5, 1.0)
        if self._stop is None:
            time.sleep(seconds)
            return True
        return not self._stop.wait(seconds)


def is_final(error: Exception) -> bool:
    """Tell whether another try cannot mend it."""
    return isinstance(error, _FINAL) or bool(_FINAL_STATUS.search(str(error)))


def reason(error: Exception) -> str:
    """Say what went wrong, without the request and the page that came with it."""
    lines = str(error).strip().splitlines()
    first = lines[0] if lines else type(error).__name__
    text = first.split(" - ")[-1].split(": <")[0].rstrip(" .:")
    return text if len(text) <= 200 else text[:197] + "..."
