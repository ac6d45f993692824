"""MAVLink frames to observations: whose each frame is, and which reader knows what it means.

    positions.py      GLOBAL_POSITION_INT_COV, GLOBAL_POSITION_INT, GPS_RAW_INT            GpsReport
    utm.py            UTM_GLOBAL_POSITION                                                  GpsReport, Intent
    high_latency.py   HIGH_LATENCY2                                GpsReport, AirData, VehicleStatus, Intent
    motion.py         ATTITUDE, ATTITUDE_QUATERNION                                        Attitude
                      RAW_IMU, SCALED_IMU, SCALED_IMU2, SCALED_IMU3, HIGHRES_IMU           ImuSample, AirData
    air.py            VFR_HUD, SCALED_PRESSURE, WIND, WIND_COV                             AirData
    condition.py      HEARTBEAT, EXTENDED_SYS_STATE; SYSTEM_TIME sets the clock            VehicleStatus
    missions.py       HOME_POSITION, MISSION_CURRENT                                       FlightPlan, Intent
    simulated.py      SIM_STATE, SIMSTATE                                                  Truth
    plans.py          MISSION_COUNT, _ITEM, _ITEM_INT, _ACK, _CLEAR_ALL, overheard         FlightPlan
    traffic.py        ADSB_VEHICLE: of other aircraft, whoever tells it                    GpsReport
    drone_id.py       OPEN_DRONE_ID_LOCATION: of the sender or of others                   GpsReport

Only vehicles speak of themselves (see vehicles.py). Frames of system 0 are nobody's. A message without a time of its own
holds at the newest time since boot that its component has told. Each reader also keeps what people are shown of a vehicle.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from types import MappingProxyType

from adapters import air, condition, drone_id, high_latency, missions, motion, positions, simulated, traffic, utm
from adapters.epoch import SessionEpoch
from adapters.mavlink_frames import Frame
from adapters.moments import Moments, Observations, Reader
from adapters.plans import MISSION_MESSAGES, overheard
from adapters.vehicle import Vehicle
from adapters.vehicles import Component, Registry
from gateway.observation import FlightPlan

_READERS: MappingProxyType[int, Reader] = MappingProxyType(
    {
        condition.HEARTBEAT: condition.heartbeat,
        condition.SYSTEM_TIME: condition.system_time,
        condition.EXTENDED_SYS_STATE: condition.extended_state,
        positions.GLOBAL_POSITION_INT: positions.estimate,
        positions.GLOBAL_POSITION_INT_COV: positions.estimate_with_covariance,
        positions.GPS_RAW_INT: positions.receiver_fix,
        utm.UTM_GLOBAL_POSITION: utm.utm_position,
        high_latency.HIGH_LATENCY2: high_latency.high_latency,
        motion.ATTITUDE: motion.attitude,
        motion.ATTITUDE_QUATERNION: motion.quaternion,
        motion.RAW_IMU: motion.raw_imu,
        motion.SCALED_IMU: motion.scaled_imu,
        motion.SCALED_IMU2: motion.scaled_imu_2,
        motion.SCALED_IMU3: motion.scaled_imu_3,
        motion.HIGHRES_IMU: motion.highres_imu,
        air.VFR_HUD: air.hud,
        air.SCALED_PRESSURE: air.pressure,
        air.WIND: air.wind,
        air.WIND_COV: air.wind_components,
        missions.HOME_POSITION: missions.home,
        missions.MISSION_CURRENT: missions.current_item,
        missions.PARAM_VALUE: missions.parameter,
        simulated.SIM_STATE: simulated.sim_state,
        simulated.SIMSTATE: simulated.simstate,
    }
)
_ROLES = MappingProxyType(
    {condition.HEARTBEAT: condition.read_heartbeat, high_latency.HIGH_LATENCY2: high_latency.read_role}
)


@dataclass(slots=True)
class MavlinkObserver:
    """All MAVLink sources of a session. What there is to say once gathers in `notes` as (level, text)."""

    epoch: SessionEpoch
    origins: dict[int, str] = field(default_factory=dict)
    notes: list[tuple[str, str]] = field(default_factory=list)
    registry: Registry = field(init=False)
    _moments: Moments = field(init=False)
    _traffic: traffic.Traffic = field(default_factory=traffic.Traffic)

    def __post_init__(self) -> None:
        self.registry = Registry(self.origins, self.notes)
        self._moments = Moments(self.epoch, self.notes)

    @property
    def wanted(self) -> frozenset[int]:
        """The messages that say something."""
        return frozenset((*_READERS, *_ROLES, *MISSION_MESSAGES, traffic.ADSB_VEHICLE, drone_id.OPEN_DRONE_ID_LOCATION))

    def hear(self, source: int, frame: Frame, received_at: int, counters: Counter[str]) -> Observations:
        """One frame of a source: what it observed; counts in the source's counters what is refused. Never raises."""
        system, message = frame.system, frame.message
        if system == 0:
            counters["system 0"] += 1
            return ()
        key = (source, system, frame.component)
        if frame.verdict == "bad checksum" and key not in self.registry.components:
            return ()  # damage is nobody new
        component = self.registry.component(*key)
        if component is None:
            counters["too many components"] += 1
            return ()
        component.sequence.hear(frame.sequence, message, counters)
        if frame.verdict != "good":
            return ()
        component.rates.hear(message, received_at)
        return self.read(component, message, frame.payload, received_at, counters)

    def read(
        self, component: Component, message: int, payload: bytes, received_at: int, counters: Counter[str]
    ) -> Observations:
        """What a good frame of a component says, apart from its sequence number. Never raises."""
        if message not in _ROLES:
            return self._read(component, message, payload, received_at, counters)
        before = component.told_by
        component.take_role(*_ROLES[message](payload)[:2])
        found = self._read(component, message, payload, received_at, counters)
        self.registry.version += component.told_by != before
        return found

    def _read(
        self, component: Component, message: int, payload: bytes, received_at: int, counters: Counter[str]
    ) -> Observations:
        if component.is_vehicle:
            reader = _READERS.get(message)
            if reader is not None:
                vehicle = self.registry.hear(component, message, payload, received_at, counters)
                if vehicle is None:
                    return ()
                return reader(self._moments, component, vehicle, payload, received_at, counters)
        if message in MISSION_MESSAGES:
            return self._mission(component, message, payload, received_at)
        if message == traffic.ADSB_VEHICLE:
            return self._traffic.hear_adsb(self._moments, payload, received_at, counters)
        if message == drone_id.OPEN_DRONE_ID_LOCATION:
            return self._drone_id(component, payload, received_at, counters)
        return ()

    def _mission(self, component: Component, message: int, payload: bytes, received_at: int) -> Observations:
        """Mission traffic: of the vehicle that tells its items, or of the one that a station tells them to."""
        told = overheard(message, payload)
        source, system, _ = component.key
        by_vehicle = component.is_vehicle
        vehicle = self.registry.of_number(source, system if by_vehicle else told.target_system)
        if not told.act or vehicle is None:
            return ()
        first_is_home = missions.begins_with_home(vehicle)
        changed = vehicle.plan.hear(told, by_vehicle=by_vehicle, begins_with_home=first_is_home)
        vehicle.words["plan"] = vehicle.plan.summary()
        if not changed:
            return ()
        if by_vehicle:
            valid_at, _ = self._moments.at_receipt(component, received_at)
        else:
            valid_at = self.epoch.session_time(received_at)
        return (FlightPlan(vehicle.name, valid_at, received_at, vehicle.plan.points()),)

    def _drone_id(self, component: Component, payload: bytes, received_at: int, counters: Counter[str]) -> Observations:
        """Remote identification: of a drone that was heard, or of the sending system, whichever component sends it."""
        name = drone_id.identity(payload)
        if name:
            return drone_id.heard_location(self._moments, self._traffic, name, payload, received_at, counters)
        vehicle: Vehicle | None = None
        if not component.is_vehicle:
            vehicle = self.registry.of_number(*component.key[:2])
        if vehicle is None:
            message = drone_id.OPEN_DRONE_ID_LOCATION
            vehicle = self.registry.hear(component, message, payload, received_at, counters)
        if vehicle is None:
            return ()
        return drone_id.own_location(self._moments, vehicle, payload, received_at, counters)
