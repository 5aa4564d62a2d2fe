"""Stages of the drive in words: ``2 s at 0.1 um/s; hold 1 s; 1 s from 0 to 1 um/s``."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from typing import Any

from mesoslip.errors import FileError
from mesoslip.quantities import with_unit

EXAMPLE = "2 s at 0.1 um/s; hold 1 s; 0.2 um at 1 um/s; 1 s from 0 to 1 um/s"
DIGITS = 6
HOLD = re.compile(r"hold (?:for )?(.+)|(.+) hold")
RAMP = re.compile(r"(.+) from (.+) to (.+)")
EVEN = re.compile(r"(.+) at (.+)")
# Units of a length; other lengths of a stage are times.
LENGTH = re.compile(r".*[\d\s.](?:[nuµm]|k|c)?m")


def read_stages(text: str) -> str:
    """Stages in words as the value of ``drive.stage`` on the command line."""
    stages = [_stage(one.strip()) for one in text.split(";") if one.strip()]
    tables = (
        ", ".join(
            f"{name} = {json.dumps(value, ensure_ascii=False)}" for name, value in stage.items()
        )
        for stage in stages
    )
    return f"[{', '.join(f'{{ {one} }}' for one in tables)}]"


def _stage(text: str) -> dict[str, str | bool]:
    if match := HOLD.fullmatch(text):
        return {"duration": match[1] or match[2], "hold": True}
    if match := RAMP.fullmatch(text):
        unit = match[3].partition(" ")[2]
        start = match[2] if " " in match[2] else f"{match[2]} {unit}"
        return {**_length(match[1]), "start_velocity": start, "end_velocity": match[3]}
    if match := EVEN.fullmatch(text):
        return {**_length(match[1]), "velocity": match[2]}
    raise FileError(f"“{text}” is no stage; stages are such as: {EXAMPLE}")


def _length(text: str) -> dict[str, str | bool]:
    """The duration or the displacement that ends a stage."""
    return {"displacement" if LENGTH.fullmatch(text) else "duration": text}


def write_stages(stages: Sequence[Mapping[str, Any]]) -> str:
    """Stages, in SI, in words."""
    return "; ".join(map(_words, stages))


def _words(stage: Mapping[str, Any]) -> str:
    units = {"duration": "s", "displacement": "m"}
    length = next(
        with_unit(stage[name], unit, DIGITS) for name, unit in units.items() if name in stage
    )
    if stage.get("hold"):
        return f"hold {length}"
    kind, unit = (
        ("velocity", "m/s") if any("velocity" in name for name in stage) else ("force", "N")
    )
    if kind in stage:
        return f"{length} at {with_unit(stage[kind], unit, DIGITS)}"
    start, end = (with_unit(stage[f"{side}_{kind}"], unit, DIGITS) for side in ("start", "end"))
    return f"{length} from {start} to {end}"
