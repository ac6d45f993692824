"""A mission given to the vehicle on a link, once, as `talkdown plan --upload` asks for.

This is the one place where we act as the ground station that commands a vehicle; we are system 254, component 190.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

from adapters.mavlink_frames import FrameEncoder
from adapters.mission_upload import MissionUpload
from adapters.mission_writing import MissionItem
from gateway.runtime.conversing import Conversation, wait
from gateway.runtime.links import Link, open_link
from gateway.runtime.manners import COMPONENT, STATION_HEARTBEAT, SYSTEMS
from gateway.runtime.urls import LinkError, Url

_WAIT_S = 0.02
_HEARTBEAT_S = 1.0


class UploadError(RuntimeError):
    """The mission was not given; the message is one plain sentence."""


def upload_mission(
    url: Url,
    items: Sequence[MissionItem],
    home: tuple[float, float, float],
    system: int | None = None,
    *,
    progress: Callable[[float], None] = lambda share: None,
) -> str:
    """Give it to the vehicle of this number, or the first that is heard; a sentence of what was done. Raises UploadError."""
    try:
        link = open_link(url)
    except LinkError as error:
        raise UploadError(str(error)) from error
    try:
        upload = _carry_out(link, MissionUpload(items, home, time.monotonic_ns(), system, SYSTEMS[0]), progress)
    finally:
        link.close()
    if upload.failure is not None:
        raise UploadError(upload.failure)
    number = upload.vehicle[0] if upload.vehicle is not None else 0
    return f"Vehicle {number} has the mission: {len(items)} items."


def _carry_out(link: Link, upload: MissionUpload, progress: Callable[[float], None]) -> MissionUpload:
    encoder, conversation = FrameEncoder(SYSTEMS[0], COMPONENT), Conversation(link)
    heartbeat_due, its_peer = 0, None
    while not upload.is_done and upload.failure is None:
        wait([link], _WAIT_S)
        now = time.monotonic_ns()
        for peer, frame in conversation.hear(now):
            upload.hear(frame, now)
            if its_peer is None and upload.vehicle is not None:
                its_peer = peer
        if conversation.heard_at and now >= heartbeat_due:
            heartbeat_due = now + round(_HEARTBEAT_S * 1e9)
            _send(link, encoder, "HEARTBEAT", STATION_HEARTBEAT, its_peer or next(iter(conversation.heard_at)))
        for name, values in upload.due(now):
            _send(link, encoder, name, values, its_peer)
        progress(upload.share)
    return upload


def _send(link: Link, encoder: FrameEncoder, name: str, values: dict[str, Any], peer: str | None) -> None:
    link.send(encoder.encode(name, **values), peer)
