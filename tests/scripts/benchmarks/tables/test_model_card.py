"""Laws of the model card's tables, and whether the card is that of the weights."""

from pathlib import Path
from typing import Any

from workspaces import identity_weights

from resdepth_colmap.network.network_config import NetworkConfig
from resdepth_colmap.network.weights import default_weights_path, weights_hash
from scripts.benchmarks.record import MEASUREMENTS, REPOSITORY, read
from scripts.benchmarks.tables.model_card import (
    CHANNELS,
    short_hash,
    training_text,
    weights_text,
)
from scripts.benchmarks.tables.weights_facts import weights_facts

CARD = REPOSITORY / "docs" / "model_card.md"


def measured(name: str) -> Any:
    return read(MEASUREMENTS / f"{name}.json")


def test_the_card_is_that_of_the_shipped_weights() -> None:
    way_out = "run python -m scripts.benchmarks.make_tables"
    assert measured("weights") == weights_facts(default_weights_path()), way_out
    card = CARD.read_text("utf-8")
    assert f"`{short_hash(weights_hash())}`" in card, way_out


def test_the_last_stage_of_the_training_made_the_shipped_weights() -> None:
    stages = measured("training")["stages"]
    assert stages[-1]["weights_sha256"] == weights_hash(), "add the stage to the file"
    for stage in stages:
        assert (REPOSITORY / "docs" / "adr" / stage["adr"]).is_file()


def test_the_documents_lead_to_the_card() -> None:
    for document, link in (
        ("README.md", "docs/model_card.md"),
        ("docs/training.md", "model_card.md"),
    ):
        assert f"]({link})" in (REPOSITORY / document).read_text("utf-8")


def test_what_the_card_says_of_a_file_is_what_the_file_is(tmp_path: Path) -> None:
    facts = weights_facts(identity_weights(tmp_path))
    text = weights_text(facts)
    assert short_hash(facts["sha256"]) in text
    assert "2 levels, 4 to 512 channels" in text
    assert "a gate that weights it; the expected error" in text
    for channel in facts["channels"]:
        assert CHANNELS[channel] in text
    plain = {**facts, "network": {**facts["network"], "gate": False}}
    assert "gate" not in weights_text(plain)


def test_every_input_of_the_default_network_has_words() -> None:
    assert set(NetworkConfig().channels) <= set(CHANNELS)


def test_a_stage_is_a_row_and_what_is_not_known_a_dash() -> None:
    stage = {
        "adr": "0005-first-weights.md",
        "starts_from": "random weights",
        "maps": "unfiltered",
        "num_rooms": 1274,
        "num_views": None,
        "steps": 4000,
        "batch_size": 4,
        "crop_px": [512, 384],
        "learning_rate": 0.001,
        "minutes": None,
        "command": None,
        "held_out": None,
        "weights_sha256": "0123456789abcdef",
    }
    known = {
        **stage,
        "command": "resdepth-colmap train ROOMS",
        "minutes": 27,
        "held_out": {"mae_ratio": 0.456, "medae_ratio": 0.9},
    }
    text = training_text({"hardware": "a machine", "stages": [stage, known]})
    assert (
        "| 1 ([ADR 0005](adr/0005-first-weights.md)) | random weights | unfiltered | "
        "1,274 | - | 4,000 | 4 of 512 x 384 | 0.001 | - | - | - | `0123456789ab` |"
    ) in text
    assert "| 27 | 0.46 | 0.90 |" in text
    assert "    resdepth-colmap train ROOMS  # stage 2" in text
    assert text.count("# stage") == 1
    rows = [line.count("|") for line in text.splitlines() if line.startswith("|")]
    assert len(set(rows)) == 1
