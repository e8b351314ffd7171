"""COLMAP's spelling of options: `--PatchMatchStereo.geom_consistency 0`."""

import collections
from collections.abc import Iterable, Iterator, Mapping

import click

PREFIX = "PatchMatchStereo."
_WORDS = {"0": False, "false": False, "1": True, "true": True}


class Command(click.Command):
    """A command that takes COLMAP's flags with a value, as COLMAP needs them."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse the command line, its flags put into our spelling first."""
        flags = {
            parameter.opts[0]: parameter.secondary_opts[:1]
            for parameter in self.params
            if isinstance(parameter, click.Option) and parameter.is_flag
        }
        return super().parse_args(ctx, list(plain_flags(args, flags)))


def plain_name(token: str) -> str:
    """COLMAP's name of an option in our spelling; other words are left alone."""
    return token.removeprefix(PREFIX).replace("_", "-")


def plain_flags(words: Iterable[str], flags: Mapping[str, list[str]]) -> Iterator[str]:
    """A command line whose flags of COLMAP's have no values.

    Args:
        words: The command line.
        flags: What turns a flag off, at most one word, by what turns it on.

    Yields:
        The words; a flag of COLMAP's and its value have become what turns it on or off.
        What is off and has no word for that is left out.
    """
    rest = collections.deque(words)
    while rest:
        word = rest.popleft()
        name, is_joined, value = word.partition("=")
        flag = f"--{plain_name(name.removeprefix('--'))}"
        if not name.startswith(f"--{PREFIX}") or flag not in flags:
            yield word
            continue
        if not is_joined and rest and rest[0].lower() in _WORDS:
            value = rest.popleft()
        if _WORDS.get(value.lower(), True):
            yield flag
        else:
            yield from flags[flag]
