"""ArduPilot's .BIN log told as MAVLink. What becomes what:

    VER, MSG, PARM, MODE, ARM, EV, STAT      HEARTBEAT, EXTENDED_SYS_STATE (each second)
    GPS, GPA of instance 0                   GPS_RAW_INT; with GMS and GWk the UTC of SYSTEM_TIME
    POS, XKF1 or NKF1 of core 0, ATT         GLOBAL_POSITION_INT, ATTITUDE
    IMU, MAG                                 HIGHRES_IMU, at the logged rate, its id the instance
    BARO with ARSP                           SCALED_PRESSURE, SCALED_PRESSURE2, SCALED_PRESSURE3; without ARSP HIGHRES_IMU
    ARSP, else CTUN with an airspeed         VFR_HUD
    XKF2 or NKF2 of core 0                   WIND
    SIM with SIM2                            SIM_STATE; without SIM2, which has the velocity, SIMSTATE
    ORGN of type 1                           HOME_POSITION
    CMD, MISE                                MISSION_COUNT and MISSION_ITEM_INT, MISSION_CURRENT

What a log does not hold is not told. UTC: see dataflash_identity.py.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import BinaryIO

from adapters.dataflash_identity import WANTED
from adapters.dataflash_reader import DataflashReader, Entry, Values
from adapters.telling import (
    ABSOLUTE_PRESSURE,
    ACCELERATION,
    FIELD,
    RATE,
    TEMPERATURE,
    Identity,
    Teller,
    centidegrees,
    compass,
    degrees_e7,
    hundredfold,
    millimetres,
    number,
    speed_cms,
)

_HOME = 1  # ORGN.Type
_ARMED_EVENT, _DISARMED_EVENT = 10, 11
_ON_GROUND, _IN_AIR = 1, 2
_FRESH_US = 500_000  # a velocity or heading older than this is not the position's
_STATION = {"target_system": 255, "target_component": 190}
_PRESSURES = ("SCALED_PRESSURE", "SCALED_PRESSURE2", "SCALED_PRESSURE3")


@dataclass(slots=True)
class DataflashFrames:
    """The frames of a .BIN log. Counters: those of the reader, "values not usable"."""

    file: BinaryIO
    identity: Identity
    counters: Counter[str] = field(default_factory=Counter)
    _teller: Teller = field(init=False)
    _latest: dict[str, tuple[int, Values]] = field(default_factory=dict)
    _has_arsp: bool = False
    _tellers: dict[str, Callable[[Values], None]] = field(init=False)

    def __post_init__(self) -> None:
        self._teller = Teller(self.identity, self.counters)
        self._tellers = {
            "GPS": self._fix,
            "POS": self._position,
            "ATT": self._attitude,
            "IMU": self._inertial,
            "MAG": self._field,
            "BARO": self._pressure,
            "ARSP": self._air,
            "CTUN": self._air,
            "XKF2": self._wind,
            "NKF2": self._wind,
            "SIM": self._truth,
            "ORGN": self._home,
            "CMD": self._item,
            "MISE": self._current,
        }

    def __iter__(self) -> Iterator[tuple[int, bytes]]:
        """Stamp (ns since 1970 UTC, strictly increasing multiples of 4000) and frame."""
        teller = self._teller
        for moment in DataflashReader(self.file, WANTED, self.counters).moments():
            for entry in moment:
                self._remember(entry)
            teller.begin(moment[0].time_us)
            for entry in moment:
                say = self._tellers.get(entry.name)
                if say is not None:
                    teller.attempt(say, entry.values)
            yield from teller.take()

    def _remember(self, entry: Entry) -> None:
        teller, values = self._teller, entry.values
        if entry.name == "STAT":
            teller.armed = bool(values.get("Armed", teller.armed))
            if "isFlying" in values:
                teller.landed = _IN_AIR if values["isFlying"] else _ON_GROUND
        elif entry.name == "ARM":
            teller.armed = bool(values.get("ArmState"))
        elif entry.name == "EV" and values.get("Id") in (_ARMED_EVENT, _DISARMED_EVENT):
            teller.armed = values["Id"] == _ARMED_EVENT
        elif entry.name == "MODE":
            mode = values.get("ModeNum", values.get("Mode"))
            teller.custom_mode = mode if isinstance(mode, int) and mode >= 0 else teller.custom_mode
        elif values.get("I", values.get("C", 0)) == 0:
            self._latest[entry.name] = (entry.time_us, values)
            self._has_arsp = self._has_arsp or entry.name == "ARSP"

    def _recent(self, *names: str) -> Values:
        """The newest entry of the first of these names that has one, if it is not old; else an empty one."""
        for name in names:
            found = self._latest.get(name)
            if found is not None and abs(self._teller.boot_us - found[0]) <= _FRESH_US:
                return found[1]
        return {}

    def _velocity(self) -> tuple[float | None, float | None, float | None]:
        """North, east, down: the estimator's, else the receiver's."""
        estimate = self._recent("XKF1", "NKF1")
        if estimate:
            return estimate.get("VN"), estimate.get("VE"), estimate.get("VD")
        fix = self._recent("GPS")
        speed, course = fix.get("Spd"), fix.get("GCrs")
        if speed is None or course is None or fix.get("Status", 0) < 3:
            return None, None, None
        angle = math.radians(course)
        return speed * math.cos(angle), speed * math.sin(angle), fix.get("VZ")

    def _fix(self, fix: Values) -> None:
        if fix.get("I", 0) != 0:
            return
        good = self._recent("GPA")
        self._teller.tell(
            "GPS_RAW_INT",
            time_usec=good["SMS"] * 1000 if good.get("SMS") else self._teller.boot_us,
            fix_type=fix["Status"],
            lat=degrees_e7(fix["Lat"]),
            lon=degrees_e7(fix["Lng"]),
            alt=round(fix["Alt"] * 1000),
            eph=hundredfold(fix.get("HDop")),
            epv=hundredfold(good.get("VDop")),
            vel=hundredfold(fix.get("Spd")),
            cog=centidegrees(fix.get("GCrs")),
            satellites_visible=fix.get("NSats", 255),
            alt_ellipsoid=round(good.get("AEl", 0.0) * 1000),
            h_acc=millimetres(good.get("HAcc")),
            v_acc=millimetres(good.get("VAcc")),
            vel_acc=millimetres(good.get("SAcc")),
        )

    def _position(self, position: Values) -> None:
        north, east, down = self._velocity()
        self._teller.tell(
            "GLOBAL_POSITION_INT",
            time_boot_ms=self._teller.boot_ms,
            lat=degrees_e7(position["Lat"]),
            lon=degrees_e7(position["Lng"]),
            alt=round(position["Alt"] * 1000),
            relative_alt=round(position.get("RelHomeAlt", 0.0) * 1000),
            vx=speed_cms(north),
            vy=speed_cms(east),
            vz=speed_cms(down),
            hdg=centidegrees(self._recent("ATT").get("Yaw")),
        )

    def _attitude(self, attitude: Values) -> None:
        gyro = self._recent("IMU")
        self._teller.tell(
            "ATTITUDE",
            time_boot_ms=self._teller.boot_ms,
            roll=math.radians(attitude["Roll"]),
            pitch=math.radians(attitude["Pitch"]),
            yaw=math.remainder(math.radians(attitude["Yaw"]), math.tau),
            rollspeed=number(gyro.get("GyrX")),
            pitchspeed=number(gyro.get("GyrY")),
            yawspeed=number(gyro.get("GyrZ")),
        )

    def _inertial(self, sample: Values) -> None:
        self._teller.measure(
            sample.get("I", 0),
            ACCELERATION | RATE | (TEMPERATURE if "T" in sample else 0),
            **{f"{axis.lower()}acc": sample[f"Acc{axis}"] for axis in "XYZ"},
            **{f"{axis.lower()}gyro": sample[f"Gyr{axis}"] for axis in "XYZ"},
            temperature=number(sample.get("T")),
        )

    def _field(self, sample: Values) -> None:
        gauss = {f"{axis.lower()}mag": sample[f"Mag{axis}"] / 1000 for axis in "XYZ"}
        self._teller.measure(sample.get("I", 0), FIELD, **gauss)

    def _pressure(self, air: Values) -> None:
        instance, difference = air.get("I", 0), self._recent("ARSP").get("DiffPress")
        if instance == 0 and difference is None:  # the other message cannot say that there is no pitot
            self._teller.measure(0, ABSOLUTE_PRESSURE, abs_pressure=air["Press"] / 100)
            return
        self._teller.tell(
            _PRESSURES[min(instance, 2)],
            time_boot_ms=self._teller.boot_ms,
            press_abs=air["Press"] / 100,
            press_diff=difference / 100 if instance == 0 and difference is not None else 0.0,
            temperature=round(air.get("Temp", 0.0) * 100),
        )

    def _air(self, air: Values) -> None:
        if "As" in air and self._has_arsp:
            return  # CTUN only repeats what the sensor's own entry says
        if air.get("I", 0) != 0 or (airspeed := air.get("Airspeed", air.get("As"))) is None:
            return
        north, east, down = self._velocity()
        heading = self._recent("ATT").get("Yaw")
        self._teller.tell(
            "VFR_HUD",
            airspeed=airspeed,
            groundspeed=math.nan if north is None or east is None else math.hypot(north, east),
            heading=-1 if heading is None else round(heading) % 360,
            throttle=round(min(max(self._recent("CTUN").get("ThO", 0.0), 0.0), 100.0)),
            alt=number(self._recent("POS").get("Alt")),
            climb=math.nan if down is None else -down,
        )

    def _wind(self, estimate: Values) -> None:
        if estimate.get("C", 0) != 0:
            return
        north, east = estimate["VWN"], estimate["VWE"]
        if north == east == 0.0:
            return  # not estimated yet
        self._teller.tell("WIND", direction=compass(-north, -east), speed=math.hypot(north, east), speed_z=0.0)

    def _truth(self, truth: Values) -> None:
        velocity, none = self._recent("SIM2"), ("xacc", "yacc", "zacc", "xgyro", "ygyro", "zgyro")
        angles = {name: math.radians(truth[name.title()]) for name in ("roll", "pitch")}
        angles["yaw"] = math.remainder(math.radians(truth["Yaw"]), math.tau)
        latitude, longitude = degrees_e7(truth["Lat"]), degrees_e7(truth["Lng"])
        rest = {**angles, **dict.fromkeys(none, math.nan)}
        if not velocity or "Q4" not in truth:
            self._teller.tell("SIMSTATE", lat=latitude, lng=longitude, **rest)
            return
        self._teller.tell(
            "SIM_STATE",
            **{f"q{place}": truth[f"Q{place}"] for place in (1, 2, 3, 4)},
            lat=truth["Lat"],
            lon=truth["Lng"],
            alt=truth["Alt"],
            std_dev_horz=0.0,
            std_dev_vert=0.0,
            vn=velocity["VN"],
            ve=velocity["VE"],
            vd=velocity["VD"],
            lat_int=latitude,
            lon_int=longitude,
            **rest,
        )

    def _home(self, origin: Values) -> None:
        if origin.get("Type") != _HOME:
            return
        self._teller.tell_home(origin["Lat"], origin["Lng"], origin["Alt"])

    def _item(self, item: Values) -> None:
        if item["CNum"] == 0:
            self._teller.tell("MISSION_COUNT", count=item["CTot"], **_STATION)
        self._teller.tell(
            "MISSION_ITEM_INT",
            seq=item["CNum"],
            frame=item.get("Frame", 3),
            command=item["CId"],
            current=0,
            autocontinue=1,
            **{f"param{place}": item.get(f"Prm{place}", 0.0) for place in (1, 2, 3, 4)},
            x=degrees_e7(item["Lat"]),
            y=degrees_e7(item["Lng"]),
            z=item["Alt"],
            **_STATION,
        )

    def _current(self, item: Values) -> None:
        self._teller.tell("MISSION_CURRENT", seq=item["CNum"], total=item.get("CTot", 0))
