"""Reasons of errors stand within sentences."""

import errno
import os

import pytest

from adapters.reasons import reason_of


def test_what_the_system_says_begins_in_lower_case_and_its_paths_stay_as_they_are() -> None:
    full = OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "/Data/Flight.rrd")
    assert reason_of(full) == "no space left on device"
    assert reason_of(OSError("Cannot write /Data/Flight.rrd.")) == "cannot write /Data/Flight.rrd"


def test_a_file_that_is_no_text_is_called_so() -> None:
    with pytest.raises(UnicodeDecodeError) as raised:
        b"\xff".decode()
    assert reason_of(raised.value) == "it is not UTF-8 text"
