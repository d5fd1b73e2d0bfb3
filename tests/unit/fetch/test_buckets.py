"""Names and keys against facts that were recorded from NOAA's buckets.

Each key was published by others who fetched it; docs/guides/fetch.md says where.
"""

import threading
from datetime import UTC, datetime
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import ClassVar

import pytest

from cloudjax_data import DataError, Link
from cloudjax_data.buckets import (
    PRODUCTS,
    SECTORS,
    gfs_file_name,
    gfs_key,
    goes_bucket,
    goes_folder,
    parse_goes_key,
)


RECORDED = {
    "ABI-L2-ACHAM/2026/216/18/"
    "OR_ABI-L2-ACHAM1-M6_G19_s20262161801249_e20262161801336_c20262161801594.nc": (
        "L2-ACHA",
        "meso1",
    ),
    "ABI-L2-CODC/2026/216/18/"
    "OR_ABI-L2-CODC-M6_G19_s20262161801170_e20262161803545_c20262161805324.nc": (
        "L2-COD",
        "conus",
    ),
    "ABI-L1b-RadF/2017/167/11/"
    "OR_ABI-L1b-RadF-M3C02_G16_s20171671145342_e20171671156109_c20171671156144.nc": (
        "L1b-Rad",
        "full",
    ),
    "ABI-L1b-RadM/2019/300/20/"
    "OR_ABI-L1b-RadM1-M6C13_G17_s20193002000275_e20193002000344_c20193002000386.nc": (
        "L1b-Rad",
        "meso1",
    ),
}


@pytest.mark.parametrize("key", RECORDED)
def test_recorded_keys_are_found_where_they_are_looked_for(key):
    product, sector = RECORDED[key]
    parsed = parse_goes_key(key)
    assert parsed is not None
    folder = goes_folder(product, SECTORS[sector], parsed.abi.start)
    assert key == f"{folder}/{parsed.name}"
    assert parsed.abi.sector == SECTORS[sector].code
    assert f"{parsed.abi.level}-{parsed.abi.product}" == product
    assert parsed.end > parsed.abi.start


def test_the_parts_of_a_key():
    parsed = parse_goes_key(list(RECORDED)[2])
    assert parsed is not None
    assert (parsed.abi.platform, parsed.abi.band) == ("G16", 2)
    assert parsed.abi.start == datetime(2017, 6, 16, 11, 45, 34, 200000, tzinfo=UTC)
    assert parsed.end == datetime(2017, 6, 16, 11, 56, 10, 900000, tzinfo=UTC)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("ABI-L1b-RadF/2017", "ABI-L1b-RadF/../2017"),
        ("OR_ABI", "../OR_ABI"),
        ("OR_ABI", "/OR_ABI"),
        ("OR_ABI", ".OR_ABI"),
        ("_c2017", "_c/../2017"),
        (".nc", ".nc/x"),
        (".nc", ".nc\n"),
        (".nc", ".nc.sh"),
        (".nc", "\x00.nc"),
        ("G16", "G٣٤"),
        ("s2017167", "s2017999"),
        ("e20171671156", "e20171679956"),
        ("RadF-", "Rad\\F-"),
        ("OR_", "IT_"),
    ],
)
def test_keys_that_are_not_all_of_the_pattern(old, new):
    key = list(RECORDED)[2]
    assert parse_goes_key(key.replace(old, new)) is None


def test_the_gfs_moved_in_march_2021():
    """Herbie's templates `aws` and `aws-old`; version 16 began at 12 UTC."""
    before, after = (datetime(2021, 3, 22, hour, tzinfo=UTC) for hour in (6, 12))
    assert gfs_key(before, 0, "0p25") == "gfs.20210322/06/gfs.t06z.pgrb2.0p25.f000"
    assert gfs_key(after, 3, "1p00") == "gfs.20210322/12/atmos/gfs.t12z.pgrb2.1p00.f003"
    assert gfs_file_name(after, 3, "1p00") == "gfs.20210322.t12z.pgrb2.1p00.f003.grib2"


def test_noaas_buckets_are_asked_without_an_endpoint():
    origins = [Link().bucket(goes_bucket(f"goes{n}")).origin for n in (16, 19)]
    assert origins == [
        "https://noaa-goes16.s3.us-east-1.amazonaws.com",
        "https://noaa-goes19.s3.us-east-1.amazonaws.com",
    ]


def test_no_optical_depth_of_mesoscale_sectors():
    """The list of products in the buckets' README has CODC and CODF only."""
    assert PRODUCTS == {"L2-ACHA": "FCM", "L2-ACM": "FCM", "L2-COD": "FC"}


class _Proxy(BaseHTTPRequestHandler):
    """Refuses every connection, and remembers where to."""

    hosts: ClassVar[list[str]] = []

    def do_CONNECT(self):
        self.hosts.append(self.path)
        self.send_error(502)

    def log_message(self, format, *args):
        pass


@pytest.fixture
def proxy():
    server = ThreadingHTTPServer(("127.0.0.1", 0), _Proxy)
    thread = threading.Thread(target=server.serve_forever, args=(0.02,))
    thread.start()
    yield f"http://127.0.0.1:{server.server_port}"
    server.shutdown()
    server.server_close()
    thread.join()


def test_the_real_request_goes_to_noaas_bucket(proxy, monkeypatch):
    """Neither credentials nor endpoints of the user's other stores matter."""
    monkeypatch.setenv("HTTPS_PROXY", proxy)
    monkeypatch.setenv("NO_PROXY", "")
    for name in ("AWS_ENDPOINT_URL", "AWS_ENDPOINT_URL_S3", "AWS_ENDPOINT"):
        monkeypatch.setenv(name, "http://127.0.0.1:9")
    monkeypatch.setenv("AWS_REGION", "eu-west-1")
    monkeypatch.setenv("AWS_ACCESS_KEY_ID", "mine")
    with pytest.raises(DataError, match="would not list ABI-L1b-RadC"):
        Link(retries=0).bucket("noaa-goes16").list("ABI-L1b-RadC/2023/116/17")
    assert set(_Proxy.hosts) == {"noaa-goes16.s3.us-east-1.amazonaws.com:443"}
