"""What `compare` and `evaluate` share: options, output and exit code."""

import json
from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import Any

import click

from resdepth_colmap.cli.options import Command

UNRECORDED = ("as_json", "output", "cache")
"""Options that change no figure; the recorded command line omits them."""


def result_options(function: Command) -> Command:
    """Give a command --json and --output."""
    as_json = click.option(
        "--json", "as_json", is_flag=True, help="Print JSON instead of tables."
    )
    output = click.option(
        "--output",
        type=click.Path(path_type=Path, dir_okay=False),
        help="Also write the JSON to this file.",
    )
    return as_json(output(function))


def parsed_tolerances(_context: click.Context, _option: object, text: str) -> Any:
    """Callback of an option: increasing distances from "0.01, 0.02"."""
    try:
        return tuple(sorted({float(word) for word in text.replace(",", " ").split()}))
    except ValueError as error:
        raise click.BadParameter(f"{text!r}: {error}.") from error


def show_failure(name: str, reason: str) -> None:
    """Print why a workspace or scene has no result."""
    click.echo(f"Error: {name}: {reason}", err=True)


def show_result(
    result: Mapping[str, Any],
    show: Callable[[Mapping[str, Any]], None],
    *,
    as_json: bool,
    output: Path | None,
) -> None:
    """Print a result, as JSON or with `show`, and write its JSON to a file.

    Raises:
        WorkspaceError: If the file cannot be written.
    """
    from resdepth_colmap.io.files import write_whole

    text = json.dumps(result, indent=2, ensure_ascii=False)
    if output is not None:
        write_whole(output, f"{text}\n".encode())
    if as_json:
        click.echo(text)
    else:
        show(result)


def exit_if_failed(
    failed: Collection[str], num_total: int, noun: str, *, as_json: bool
) -> None:
    """Exit with code 1 if any of the workspaces or scenes (`noun`) failed.

    A summary names them: on stdout, or on stderr where stdout has JSON.
    """
    if failed:
        names = ", ".join(failed)
        summary = f"{len(failed)} of {num_total} {noun} failed: {names}"
        click.echo(summary, err=as_json)
        click.get_current_context().exit(1)
