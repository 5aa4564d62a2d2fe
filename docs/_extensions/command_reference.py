"""The reference of the command line, made from the commands."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator
from typing import Any

import typer
from mesoslip.command_line.main import app

INTRODUCTION = """\
# Command line

`mesoslip COMMAND --help` prints the same. Exit status 0 is success; 2 is a bad command line or
configuration, with one message that names the key, the value and what would be right; 1 is a
failed run; 130 is Ctrl-C, after which there is a checkpoint. No output is ever half-written
under its final name.
"""


def command_page() -> str:
    """All commands with their arguments and options."""
    group: Any = typer.main.get_command(app)
    parts = [INTRODUCTION]
    for name, command in group.commands.items():
        # Help that is made when it is asked for.
        getattr(command, "complete_help", lambda: None)()
        parts += [f"## {name}", "", _usage(name, command), "", _help(command), ""]
        parts += [*_rows(command), ""]
    return "\n".join(parts)


def _usage(name: str, command: Any) -> str:
    arguments = []
    for one in command.params:
        if one.param_type_name == "argument":
            label = one.metavar or one.name.upper()
            arguments.append(label if one.required else f"[{label}]")
    return f"```text\nmesoslip {' '.join([name, *arguments])} [OPTIONS]\n```"


def _help(command: Any) -> str:
    return inspect.cleandoc(command.help or "").replace("\b\n", "").replace("``", "`")


def _rows(command: Any) -> Iterator[str]:
    yield "| argument or option | meaning | default |"
    yield "|---|---|---|"
    for one in command.params:
        if one.name == "help":
            continue
        if one.param_type_name == "argument":
            label = f"`{one.metavar or one.name.upper()}`"
        else:
            value = "" if one.is_flag else f" {one.metavar or one.name.upper()}"
            names = [*one.opts, *one.secondary_opts]
            label = ", ".join(f"`{option}{value}`" for option in names)
        default = one.default
        is_shown = default is not None and default != [] and default != () and default is not False
        shown = f"`{default}`" if is_shown and not callable(default) else ""
        if one.required:
            shown = "needed"
        if default is True:
            shown = f"`{one.opts[0]}`"
        yield f"| {label} | {_plain(one.help or '')} | {shown} |"


def _plain(text: str) -> str:
    """A text in which nothing is meant to be markup."""
    return re.sub(r"([*_<>|$`\\])", r"\\\1", text)
