"""Laws of COLMAP's spelling: what COLMAP's command lines say, ours understand."""

import click
import pytest
from click.testing import CliRunner

from resdepth_colmap.cli.colmap_spelling import plain_flags, plain_name
from resdepth_colmap.cli.options import build_config, command, config_options
from resdepth_colmap.config import StereoConfig
from resdepth_colmap.errors import ConfigError

FLAGS = {"--filter": ["--no-filter"], "--write-graph": []}


def config_of(*words: str) -> StereoConfig:
    """What a command with the options of PatchMatch makes of these words."""
    found: list[StereoConfig] = []

    @command("Match.")
    @click.argument("workspace")
    @config_options(StereoConfig)
    def match(workspace: str, **values: object) -> None:
        assert workspace == "dense"
        found.append(build_config(StereoConfig, values))

    match.context_settings["token_normalize_func"] = plain_name
    CliRunner().invoke(match, words, catch_exceptions=False)
    return found[0]


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["--PatchMatchStereo.filter", "0"], {"filter": False}),
        (["--PatchMatchStereo.filter=false"], {"filter": False}),
        (["--PatchMatchStereo.filter", "TRUE"], {"filter": True}),
        (["--PatchMatchStereo.filter"], {"filter": True}),
        (["--PatchMatchStereo.geom_consistency", "0"], {"geom_consistency": False}),
        (["--no-geom-consistency"], {"geom_consistency": False}),
        (
            ["--PatchMatchStereo.write_consistency_graph", "1"],
            {"write_consistency_graph": True},
        ),
        (
            ["--PatchMatchStereo.write_consistency_graph", "0"],
            {"write_consistency_graph": False},
        ),
        (["--PatchMatchStereo.depth_min=0.5", "--depth_max", "2"], {"depth_max": 2.0}),
        (["--PatchMatchStereo.cache_size", "32"], {"cache_size": 32.0}),
        (["--PatchMatchStereo.filter_min_ncc", "-0.5"], {"filter_min_ncc": -0.5}),
    ],
)
@pytest.mark.parametrize("place", [0, 1])
def test_colmaps_options_mean_the_same_here(
    words: list[str], expected: dict[str, object], place: int
) -> None:
    line = ["dense", *words] if place == 0 else [*words, "dense"]
    options = config_of(*line).to_mapping()
    assert {name: options[name] for name in expected} == expected


def test_only_colmaps_flags_take_a_value() -> None:
    assert list(plain_flags(["--filter", "0"], FLAGS)) == ["--filter", "0"]
    line = ["a", "--PatchMatchStereo.write_graph", "0", "--PatchMatchStereo.other", "0"]
    assert list(plain_flags(line, FLAGS)) == ["a", "--PatchMatchStereo.other", "0"]


@pytest.mark.parametrize(
    "options",
    [
        {"depth_min": 0.0, "depth_max": 0.0},
        {"depth_min": 0.0, "depth_max": 3.0},
        {"depth_min": 3.0, "depth_max": 2.0},
        {"depth_min": 2.0},
        {"depth_max": 2.0},
        {"depth_min": float("nan"), "depth_max": 2.0},
        {"filter_min_ncc": 1.5},
        {"filter_min_triangulation_angle": -1.0},
        {"filter_min_num_consistent": -1},
        {"filter_geom_consistency_max_cost": -1.0},
        {"cache_size": -1.0},
        {"write_consistency_graph": True, "filter": False},
    ],
)
def test_an_option_out_of_range_names_itself_and_what_is_expected(
    options: dict[str, float],
) -> None:
    with pytest.raises(ConfigError, match=rf"{next(iter(options))}=.* but expected"):
        StereoConfig(**options)  # type: ignore[arg-type] # passed on
