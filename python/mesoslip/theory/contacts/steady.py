"""Limits of the theories of steady sliding."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from mesoslip.errors import ConfigError, Problem

if TYPE_CHECKING:
    from mesoslip.configuration.config import Config

ONE_NEWBORN_FORCE = (
    "has no theory of steady sliding for contacts that age or break by thermal activation: they "
    "must attach with one force"
)


def steady_problems(config: Config) -> Iterator[Problem]:
    """Keys without which no contacts slide steadily."""
    if not config.contacts.reattach:
        yield Problem("", "contacts.reattach", "without it there is no steady sliding", False)


def newborn_problems(config: Config) -> Iterator[Problem]:
    """Keys with which contacts attach with different forces."""
    width = config.contacts.newborn_width
    if width > 0:
        yield Problem("", "contacts.newborn_width", ONE_NEWBORN_FORCE, width)


def check_steady(config: Config) -> None:
    """Refuse contacts that do not attach again, or attach with different forces."""
    problems = [*steady_problems(config), *newborn_problems(config)]
    if problems:
        raise ConfigError(problems)
