"""A group of commands whose modules are imported when they are asked for."""

import importlib
from typing import Any

import click


class LazyGroup(click.Group):
    """One module a command; help and a wrong name import none of them needlessly."""

    def __init__(
        self,
        *args: Any,
        module_prefix: str,
        commands_in: tuple[str, ...],
        **kwargs: Any,
    ) -> None:
        """The attribute NAME of the module PREFIX + NAME, for each name, in order."""
        super().__init__(*args, **kwargs)
        self.module_prefix = module_prefix
        self.commands_in = commands_in

    def list_commands(self, ctx: click.Context) -> list[str]:
        """The commands, in the order a user meets them."""
        return list(self.commands_in)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """The command of that name, None if there is none."""
        if cmd_name not in self.commands_in:
            return None
        module = importlib.import_module(self.module_prefix + cmd_name)
        command: click.Command = getattr(module, cmd_name)
        return command
