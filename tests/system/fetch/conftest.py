"""A real S3 server on the loopback address, and a mischievous one before it."""

import contextlib
import logging
from collections.abc import Iterator
from pathlib import Path

import boto3
import pytest
from moto.server import ThreadedMotoServer

from cloudjax_data import Link
from tests.mischief import Mischief


# Import order: eccodes brings a PROJ of its own, and pyproj crashes after it.
with contextlib.suppress(ImportError):
    import pyproj  # noqa: F401


class Store:
    """Buckets of a server, filled from folders."""

    def __init__(self, port: int):
        self.port = port
        self._client = boto3.client(
            "s3",
            endpoint_url=f"http://127.0.0.1:{port}",
            aws_access_key_id="none",
            aws_secret_access_key="none",
            region_name="us-east-1",
        )

    def fill(self, root: Path) -> None:
        """A bucket for each folder of a root, readable by anybody."""
        for bucket in sorted(folder for folder in root.iterdir() if folder.is_dir()):
            self._client.create_bucket(Bucket=bucket.name, ACL="public-read")
            for file in sorted(bucket.rglob("*")):
                if file.is_file():
                    self._client.put_object(
                        Bucket=bucket.name,
                        Key=file.relative_to(bucket).as_posix(),
                        Body=file.read_bytes(),
                        ACL="public-read",
                    )

    def empty(self) -> None:
        for bucket in self._client.list_buckets()["Buckets"]:
            name = bucket["Name"]
            pages = self._client.get_paginator("list_objects_v2")
            for page in pages.paginate(Bucket=name):
                for entry in page.get("Contents", []):
                    self._client.delete_object(Bucket=name, Key=entry["Key"])
            self._client.delete_bucket(Bucket=name)

    def close(self) -> None:
        self._client.close()


@pytest.fixture(scope="session")
def server() -> Iterator[Store]:
    logging.getLogger("werkzeug").setLevel(logging.ERROR)
    server = ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    server.start()
    store = Store(server.get_host_and_port()[1])
    yield store
    store.close()
    server.stop()


@pytest.fixture
def root(tmp_path) -> Path:
    """Where to put buckets that `mischief` is to serve."""
    root = tmp_path / "buckets"
    root.mkdir()
    return root


@pytest.fixture
def store(server) -> Iterator[Store]:
    yield server
    server.empty()


@pytest.fixture
def mischief(store) -> Iterator[Mischief]:
    mischief = Mischief(store.port)
    yield mischief
    mischief.close()


@pytest.fixture
def link(mischief) -> Link:
    """A link without patience."""
    return Link(
        endpoint=mischief.url,
        timeout_s=1.0,
        retries=2,
        first_wait_s=0.01,
        connections=2,
    )
