"""The command line of the command that is running, for records that are published."""

import shlex
from pathlib import Path
from typing import Any

import click


def command_line(skip: tuple[str, ...] = ()) -> str:
    """What was typed, without the folders of this machine and without defaults.

    Args:
        skip: Names of parameters to leave out.
    """
    context = click.get_current_context()
    words = context.command_path.split()
    for parameter in context.command.params:
        name = parameter.name or ""
        source = context.get_parameter_source(name)
        is_default = source in (None, click.core.ParameterSource.DEFAULT)
        if not is_default and name in context.params and name not in skip:
            words += _words(parameter, context.params[name])
    return shlex.join(words)


def _words(parameter: click.Parameter, value: Any) -> list[str]:
    is_many = parameter.nargs != 1 or parameter.multiple
    values = [_short(it) for it in (value if is_many else [value])]
    if not isinstance(parameter, click.Option):
        return values
    if parameter.is_flag:
        return [(parameter.opts if value else parameter.secondary_opts)[0]]
    if parameter.multiple:
        return [word for it in values for word in (parameter.opts[0], it)]
    return [parameter.opts[0], *values]


def _short(value: Any) -> str:
    return value.name or "." if isinstance(value, Path) else str(value)
