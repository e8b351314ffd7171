"""Put what was measured (docs/measurements/*.json) into the documents.

    python -m scripts.benchmarks.make_tables

Run it after a bench script, or after other weights were put into the package (their
figures go to docs/measurements/weights.json); a test fails while documents and figures
differ.
"""

import json
from pathlib import Path

from resdepth_colmap.network.weights import default_weights_path
from scripts.benchmarks.tables.documents import DOCUMENTS, filled_in, rendered
from scripts.benchmarks.tables.weights_facts import weights_facts

REPOSITORY = Path(__file__).resolve().parents[2]
MEASUREMENTS = REPOSITORY / "docs" / "measurements"


def main() -> None:
    """Look at the weights, and fill in each document that is there."""
    facts = json.dumps(weights_facts(default_weights_path()), indent=2)
    (MEASUREMENTS / "weights.json").write_text(facts + "\n", "utf-8")
    for document in DOCUMENTS:
        path = REPOSITORY / document
        if not path.is_file():
            continue
        places = rendered(document, MEASUREMENTS)
        path.write_text(filled_in(path.read_text("utf-8"), places), "utf-8")
        print(f"{document}: {', '.join(places) or 'nothing measured yet'}")


if __name__ == "__main__":
    main()
