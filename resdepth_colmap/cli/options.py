"""Options of the command line, made from the configurations: nothing is said twice.

Name, type, default and help text of an option are those of the dataclass's attribute.
"""

import dataclasses
import enum
import inspect
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

import click

from resdepth_colmap.cli import colmap_spelling
from resdepth_colmap.config import Config

Command = TypeVar("Command", bound=Callable[..., Any])
ConfigType = TypeVar("ConfigType", bound=Config)

workspace_argument = click.argument("workspace", type=click.Path(path_type=Path))
overwrite_option = click.option(
    "--overwrite", is_flag=True, help="Do again what is finished and unchanged."
)


def example(*lines: str) -> str:
    """The end of a help text: command lines to copy."""
    shown = "\n".join(f"  resdepth-colmap {line}" for line in lines)
    return f"\b\nExample:\n{shown}"  # \b: click leaves the line breaks


def command(short_help: str, *lines: str) -> Callable[[Command], click.Command]:
    """Make a command of a function: with examples, and with -v and -q of its own.

    Args:
        short_help: Its line in the list of commands.
        lines: Examples, without the name of the program.
    """

    def decorate(function: Command) -> click.Command:
        make = click.command(
            cls=colmap_spelling.Command, short_help=short_help, epilog=example(*lines)
        )
        return make(verbosity_options(function))

    return decorate


def verbosity_options(function: Command) -> Command:
    """Give a command -v and -q, before or after its name."""

    def option(*names: str, sign: int, text: str) -> Callable[[Command], Command]:
        def log_more(context: click.Context, _option: object, count: int) -> None:
            from resdepth_colmap.cli.log import start_log

            root = context.find_root()
            root.obj = (root.obj or 0) + sign * count
            start_log(root.obj)

        return click.option(
            *names, count=True, expose_value=False, callback=log_more, help=text
        )

    text = "Say more; twice: say everything."
    louder = option("-v", "--verbose", sign=1, text=text)
    text = "Warnings only; twice: errors only."
    return louder(option("-q", "--quiet", sign=-1, text=text)(function))


def enum_option(
    *names: str, kind: type[enum.StrEnum], default: enum.StrEnum, text: str
) -> Callable[[Command], Command]:
    """An option that takes one of the words of an enumeration."""
    # click's own Choice of an enumeration takes the names of its members instead.
    return click.option(
        *names,
        type=click.Choice([str(word) for word in kind]),
        default=str(default),
        show_default=True,
        callback=lambda _context, _option, word: kind(word),
        help=text,
    )


def config_options(
    kind: type[Config], *names: str, skip: tuple[str, ...] = ()
) -> Callable[[Command], Command]:
    """Give a command the options of a configuration.

    Args:
        kind: The configuration.
        names: Which of its attributes, in this order; none = all.
        skip: Attributes to leave out when `names` is empty.
    """
    fields = {field.name: field for field in dataclasses.fields(kind)}
    helps = attribute_helps(kind)
    chosen = names or tuple(name for name in fields if name not in skip)

    def decorate(command: Command) -> Command:
        for name in reversed(chosen):
            command = _option(fields[name], helps.get(name, ""))(command)
        return command

    return decorate


def build_config(kind: type[ConfigType], values: Mapping[str, Any]) -> ConfigType:
    """The configuration from a command's values; it takes what it knows.

    Raises:
        ConfigError: If a value is out of range.
    """
    names = {field.name for field in dataclasses.fields(kind)}
    return kind(**{name: value for name, value in values.items() if name in names})


def given_values(kind: type[Config], values: Mapping[str, Any]) -> dict[str, Any]:
    """Those of a configuration's values that the user typed, defaults left out."""
    context = click.get_current_context()
    default = click.core.ParameterSource.DEFAULT
    return {
        field.name: values[field.name]
        for field in dataclasses.fields(kind)
        if context.get_parameter_source(field.name) is not default
    }


def attribute_helps(kind: type[Any]) -> dict[str, str]:
    """The text of each attribute in the "Attributes:" of a class's docstring."""
    text = inspect.cleandoc(kind.__doc__ or "").partition("Attributes:\n")[2]
    found = re.findall(r"^ {4}(\w+): (.+(?:\n {8}.+)*)", text, re.MULTILINE)
    return {name: " ".join(words.split()) for name, words in found}


def _option(field: "dataclasses.Field[Any]", text: str) -> Callable[[Command], Command]:
    flag = "--" + field.metadata.get("option", field.name).replace("_", "-")
    if isinstance(field.default, bool):
        flag += f"/--no-{flag[2:]}" if field.default else ""
        return click.option(
            flag, field.name, is_flag=True, default=field.default, help=text
        )
    if isinstance(field.default, enum.StrEnum):
        kind = type(field.default)
        return enum_option(
            flag, field.name, kind=kind, default=field.default, text=text
        )
    return click.option(
        flag,
        field.name,
        type=_click_type(field.default),
        default=field.default,
        show_default=field.default is not None,
        help=text,
    )


def _click_type(default: Any) -> Any:
    if default is None:  # the only options without a value are files
        return click.Path(path_type=Path)
    return type(default)
