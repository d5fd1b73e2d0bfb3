"""Byte ranges from index lines as NOAA writes them.

The lines are those of gfs.20250801/00/atmos/gfs.t00z.pgrb2.0p25.f000.idx, of 50, 70,
850 and 1000 hPa and of the ground, with their offsets.
"""

import itertools as it
from datetime import UTC, datetime

import pytest

from cloudjax_data import gfs_index
from cloudjax_data.gfs_index import Message, joined_ranges, needed_messages
from cloudjax_data.weather_fields import GROUND, OPTIONAL, REQUIRED
from cloudjax_data.weather_sky import SKY


CYCLE = datetime(2025, 8, 1, 0, tzinfo=UTC)
SIZE = 507_600_000
RECORDED = """\
207:157628280:d=2025080100:RWMR:50 mb:anl:
210:160763861:d=2025080100:O3MR:50 mb:anl:
211:162062087:d=2025080100:HGT:70 mb:anl:
212:162717610:d=2025080100:TMP:70 mb:anl:
213:163490049:d=2025080100:RH:70 mb:anl:
214:163899907:d=2025080100:SPFH:70 mb:anl:
215:164731735:d=2025080100:VVEL:70 mb:anl:
216:165947964:d=2025080100:DZDT:70 mb:anl:
217:167100613:d=2025080100:UGRD:70 mb:anl:
218:168038378:d=2025080100:VGRD:70 mb:anl:
219:168901404:d=2025080100:ABSV:70 mb:anl:
461:334588216:d=2025080100:HGT:850 mb:anl:
462:335513131:d=2025080100:TMP:850 mb:anl:
463:336380782:d=2025080100:RH:850 mb:anl:
464:337256834:d=2025080100:TCDC:850 mb:anl:
465:337712362:d=2025080100:SPFH:850 mb:anl:
466:338979120:d=2025080100:VVEL:850 mb:anl:
467:340229694:d=2025080100:DZDT:850 mb:anl:
468:341424801:d=2025080100:UGRD:850 mb:anl:
469:342393113:d=2025080100:VGRD:850 mb:anl:
470:343366675:d=2025080100:ABSV:850 mb:anl:
471:344330601:d=2025080100:CLMR:850 mb:anl:
472:344715176:d=2025080100:ICMR:850 mb:anl:
542:394099454:d=2025080100:TMP:1000 mb:anl:
543:394979746:d=2025080100:RH:1000 mb:anl:
544:395794324:d=2025080100:TCDC:1000 mb:anl:
558:404654625:d=2025080100:HGT:1000 mb:anl:
559:405672058:d=2025080100:REFD:4000 m above ground:anl:
561:406808440:d=2025080100:PRES:surface:anl:
562:407654846:d=2025080100:HGT:surface:anl:
563:408147289:d=2025080100:TMP:surface:anl:
564:408722732:d=2025080100:TSOIL:0-0.1 m below ground:anl:
580:414591098:d=2025080100:TMP:2 m above ground:anl:
581:415111060:d=2025080100:SPFH:2 m above ground:anl:
618:438903323:d=2025080100:HGT:tropopause:anl:
658:479424413:d=2025080100:TMP:30-0 mb above ground:anl:
682:497738152:d=2025080100:LAND:surface:anl:
683:497770188:d=2025080100:ICEC:surface:anl:
696:507107440:d=2025080100:VWSH:PV=-2e-06 (Km^2/kg/s) surface:anl:
"""


def test_recorded_lines_give_the_messages_and_nothing_else():
    messages = needed_messages(RECORDED, SIZE, CYCLE, 0)
    levels = {(m.name, m.level) for m in messages if m.level_type == "isobaricInhPa"}
    every = {"u", "v", "w", "r", "t", "gh"}
    assert levels == {
        *it.product(every, (70.0, 850.0)),
        ("clwmr", 850.0),
        ("icmr", 850.0),
        *it.product({"tcc"}, (850.0, 1000.0)),
        *it.product({"t", "r", "gh"}, (1000.0,)),
    }
    ground = {(m.level_type, m.name) for m in messages} - {
        ("isobaricInhPa", name) for name in (*every, *OPTIONAL)
    }
    assert ground == {*GROUND.values(), ("tropopause", "gh")}
    assert Message("isobaricInhPa", "w", 850.0, 338979120, 340229694) in messages
    assert Message("surface", "lsm", 0.0, 497738152, 497770188) in messages
    assert Message("heightAboveGround", "2t", 2.0, 414591098, 415111060) in messages


def test_neighbours_are_asked_for_together():
    ranges = joined_ranges(needed_messages(RECORDED, SIZE, CYCLE, 0))
    assert ranges[3:7] == (
        (334588216, 337712362),
        (338979120, 340229694),
        (341424801, 343366675),
        (344330601, 405672058),
    )
    assert ranges[-1] == (497738152, 497770188)


def test_the_last_message_ends_with_the_file():
    index = RECORDED[: RECORDED.index("683:")]
    last = needed_messages(index, SIZE, CYCLE, 0)[-1]
    assert (last.name, last.end) == ("lsm", SIZE)


def test_forecasts_and_the_older_name_of_cloud_water():
    index = RECORDED.replace(":anl:", ":3 hour fcst:").replace("CLMR", "CLWMR")
    averaged = "700:507300000:d=2025080100:TMP:surface:0-3 hour ave fcst:\n"
    messages = needed_messages(index + averaged, SIZE, CYCLE, 3)
    assert messages == needed_messages(RECORDED, SIZE, CYCLE, 0)


def test_covers_of_layers_are_asked_for():
    """As `wgrib2` names them in the indices of 2025, at offsets of their order."""
    lines = [
        f"{700 + i}:{507200000 + 1000 * i}:d=2025080100:{parameter}:{level}:anl:\n"
        for i, (parameter, level) in enumerate(field.index for field in SKY.values())
        if (parameter, level) != ("HGT", "tropopause")
    ]
    messages = needed_messages(RECORDED + "".join(lines), SIZE, CYCLE, 0)
    found = {(m.level_type, m.name) for m in messages}
    assert {field.kinds[0] for field in SKY.values()} <= found
    assert ("lowCloudLayer", "lcc") in found


def test_winds_that_share_a_message():
    """As `wgrib2` numbers submessages: 1.1 and 1.2 at one offset."""
    index = RECORDED.replace("468:341424801", "468.1:341424801")
    index = index.replace("469:342393113", "468.2:341424801")
    messages = needed_messages(index, SIZE, CYCLE, 0)
    u, v = (m for m in messages if m.start == 341424801)
    assert {u.name, v.name} == {"u", "v"}
    assert u.end == v.end == 343366675
    ranges = joined_ranges(messages)
    assert sum(end - start for start, end in ranges) == sum(
        end - start for start, end in {(m.start, m.end) for m in messages}
    )


@pytest.mark.parametrize(
    ("index", "size", "lead", "words"),
    [
        ("", SIZE, 0, "does not fit"),
        (RECORDED, 500_000_000, 0, "does not fit the file of 500000000 bytes"),
        (RECORDED.replace(":VVEL:", ":DZDT:"), SIZE, 0, "has no w on"),
        (RECORDED, SIZE, 3, "has no u, v, w, r, t, gh on"),
        (RECORDED + "Not Found\n", SIZE, 0, "has a line that is none of an index"),
        (RECORDED.replace("d=2025080100", "d=2025080106", 1), SIZE, 0, "cycle"),
    ],
)
def test_an_index_that_will_not_do(index, size, lead, words):
    with pytest.raises(ValueError, match=words):
        needed_messages(index, size, CYCLE, lead)


def test_the_reader_and_the_fetch_share_their_list():
    assert set(gfs_index._ON_LEVELS) == {*REQUIRED, *OPTIONAL}
    assert set(gfs_index._AT_THE_GROUND) == set(GROUND)
