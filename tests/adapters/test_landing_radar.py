"""The landing-radar codec against the vectors of the wire's contract."""

import json
import math
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest

from adapters.landing_radar import Datagram, Header, Plot, Status, decode, encode
from adapters.radar import observations
from gateway.observation import RadarPlot, RadarStatus, Timing

VECTORS: list[dict[str, Any]] = json.loads((Path(__file__).parent / "data" / "landing-radar-vectors.json").read_text())
VALID = [vector for vector in VECTORS if vector["expect"]["ok"]]
INVALID = [vector for vector in VECTORS if not vector["expect"]["ok"]]
WITH_SURPLUS = {"longer records, surplus ignored", "three plots, each with something not measured"}


def _bytes_and_key(vector: dict[str, Any]) -> tuple[bytes, bytes | None]:
    return bytes.fromhex(vector["hex"]), bytes.fromhex(vector["key"]) if vector["key"] else None


def _decoded(vector: dict[str, Any]) -> Datagram:
    found = decode(*_bytes_and_key(vector))
    assert isinstance(found, Datagram), found
    return found


def _as_written(datagram: Datagram) -> dict[str, Any]:
    """A datagram with the vectors' names of fields."""
    header = asdict(datagram.header)
    header["time_ns"] = header.pop("time")
    rows = [asdict(record) for record in datagram.records]
    for row in rows:
        if "time" in row:
            row["time_ns"] = row.pop("time")
    return {"ok": True, "header": header, "records": rows}


@pytest.mark.parametrize("vector", VALID, ids=lambda vector: vector["name"])
def test_valid_datagrams_decode_to_exactly_what_the_contract_says(vector: dict[str, Any]) -> None:
    assert _as_written(_decoded(vector)) == vector["expect"]


@pytest.mark.parametrize("vector", INVALID, ids=lambda vector: vector["name"])
def test_invalid_datagrams_are_refused_for_the_reason_of_the_contract(vector: dict[str, Any]) -> None:
    assert decode(*_bytes_and_key(vector)) == vector["expect"]["reason"]


def test_the_contract_names_nineteen_datagrams_seven_of_them_refused_after_the_magic() -> None:
    """Guards the copy of the vectors: a shorter file would make the tests above say less."""
    assert len(VECTORS) == 19
    assert {vector["expect"]["reason"] for vector in INVALID} == {
        "tag", "magic", "version", "kind", "radar", "checksum", "length",
    }  # fmt: skip


@pytest.mark.parametrize("vector", VALID, ids=lambda vector: vector["name"])
def test_what_was_decoded_encodes_to_a_datagram_that_decodes_equal(vector: dict[str, Any]) -> None:
    data, key = _bytes_and_key(vector)
    datagram = _decoded(vector)
    again = encode(datagram.header, datagram.records, key=key)
    assert decode(again, key) == datagram
    assert (again == data) == (vector["name"] not in WITH_SURPLUS)


def _altered(at: int, value: bytes, *, base: str = "one full plot") -> bytes:
    """A valid datagram with some bytes changed and the checksum made right again."""
    import zlib

    data = bytearray(next(_bytes_and_key(vector)[0] for vector in VECTORS if vector["name"] == base)[:-4])
    data[at : at + len(value)] = value
    return bytes(data) + zlib.crc32(data).to_bytes(4, "big")


@pytest.mark.parametrize(
    ("at", "value", "base"),
    [
        (32 + 4, (1_800_000_001).to_bytes(4, "big"), "one full plot"),
        (32 + 8, (-900_000_001).to_bytes(4, "big", signed=True), "one full plot"),
        (12, (7_258_118_400 * 10**9).to_bytes(8, "big"), "one full plot"),
        (24, b"\x04", "status"),
        (25, b"\x02", "status"),
    ],
    ids=["azimuth beyond a half turn", "elevation beyond the nadir", "the year 2200", "unknown state", "unknown mode"],
)
def test_values_that_cannot_be_are_refused_as_value(at: int, value: bytes, base: str) -> None:
    assert decode(_altered(at, value, base=base)) == "value"


def test_a_value_that_cannot_be_does_no_harm_in_a_field_that_was_not_measured() -> None:
    wild = _altered(32 + 4, (2_000_000_000).to_bytes(4, "big"))
    unmeasured = bytearray(wild[:-4])
    unmeasured[26:28] = (0x1D).to_bytes(2, "big")  # all but azimuth
    import zlib

    found = decode(bytes(unmeasured) + zlib.crc32(unmeasured).to_bytes(4, "big"))
    assert isinstance(found, Datagram)
    assert isinstance(found.records[0], Plot)
    assert found.records[0].azimuth_deg is None


def test_the_first_rule_broken_names_the_refusal() -> None:
    """A wrong version in a datagram of wrong length is a version; a wrong radar with a wrong checksum is a checksum."""
    data = bytes.fromhex(VECTORS[0]["hex"])
    assert decode(data[:2] + b"\x02" + data[3:] + b"\0") == "version"
    assert decode(data[:4] + b"\0\0" + data[6:]) == "checksum"
    assert decode(_altered(4, b"\0\0"), b"key") == "radar"


def test_a_tag_is_ignored_where_no_key_is_set() -> None:
    vector = next(vector for vector in VECTORS if vector["name"] == "wrong tag, right checksum")
    found = decode(bytes.fromhex(vector["hex"]))
    assert isinstance(found, Datagram)
    assert not found.header.authenticated


def test_what_does_not_fit_the_wire_is_an_error_of_the_sender() -> None:
    header = Header("plots", 1, 0, 0)
    with pytest.raises(ValueError, match="41 records"):
        encode(header, [Plot(1, 0)] * 41)
    with pytest.raises(ValueError, match="does not fit"):
        encode(header, [Plot(1, 0, range_m=5e7)])
    with pytest.raises(ValueError, match="does not belong"):
        encode(header, [Status("off", "search", 0.4, 0.0, 0.0, 0.0, 0.0)])


def test_plots_become_observations_in_radians_at_the_time_of_measurement() -> None:
    (plot,) = observations(_decoded(VECTORS[0]), 77, Timing.FOREIGN)
    assert plot == RadarPlot(
        radar=1,
        track_number=3,
        valid_at=1792500000121956789,
        received_at=77,
        range_m=12345.67,
        azimuth_rad=math.radians(-2.5),
        elevation_rad=math.radians(3.1234567),
        radial_velocity_mps=-71.23,
        snr_db=23.5,
        range_sigma_m=15.0,
        azimuth_sigma_rad=0.001,
        elevation_sigma_rad=0.001,
        timing=Timing.FOREIGN,
    )


def test_a_status_becomes_an_observation_in_radians() -> None:
    (status,) = observations(_decoded(VECTORS[3]), 77, Timing.UTC)
    assert status == RadarStatus(
        1, 1792500000123456789, 77, "operating", "precision approach", 0.4,
        math.radians(31.0), math.radians(104.0), 503.0, math.radians(270.0),
    )  # fmt: skip
