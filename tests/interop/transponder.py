"""A ground station made of MAVSDK: prints each traffic report that its transponder plugin tells, as JSON, until stdin ends.

Usage: transponder.py PORT
"""

from __future__ import annotations

import json
import sys
import time

from mavsdk.component_type import ComponentType
from mavsdk.mavsdk import Configuration, Mavsdk
from mavsdk.plugins.transponder.transponder import AdsbVehicle, Transponder

FIELDS = [
    *("icao_address", "latitude_deg", "longitude_deg", "altitude_type", "absolute_altitude_m", "heading_deg"),
    *("horizontal_velocity_m_s", "vertical_velocity_m_s", "callsign", "emitter_type", "squawk", "tslc_s"),
]


def tell(report: AdsbVehicle, _: object = None) -> None:
    """Print one report."""
    print("report " + json.dumps({name: getattr(report, name) for name in FIELDS}), flush=True)


def main() -> None:
    """Listen on the port; take the traffic of the first system that is heard."""
    station = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    station.add_any_connection(f"udpin://127.0.0.1:{sys.argv[1]}")
    print("listening", flush=True)
    while not station.get_systems():
        time.sleep(0.05)
    system = station.get_systems()[0]
    print(f"system {json.dumps([system.get_system_id(), system.component_ids()])}", flush=True)
    transponder = Transponder(system)
    transponder.subscribe_transponder(tell)
    sys.stdin.read()
    transponder.destroy()
    station.destroy()


main()
