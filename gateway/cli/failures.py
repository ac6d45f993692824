"""Failures that people are told in one plain sentence."""

from __future__ import annotations


class Failure(Exception):
    """Something expected that ends the program; the message is one plain sentence."""

    exit_code = 1


class UsageError(Failure):
    """Wrong usage or a wrong site file."""

    exit_code = 2


class RunError(Failure):
    """A failure while running."""

    exit_code = 1
