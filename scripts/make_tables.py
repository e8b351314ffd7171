"""Put what was measured (docs/measurements/*.json) into the documents.

    python scripts/make_tables.py

Run it after a bench script; a test fails while documents and figures differ.
"""

from pathlib import Path

from resdepth_colmap.evaluation.tables import DOCUMENTS, filled_in, rendered

REPOSITORY = Path(__file__).resolve().parents[1]
MEASUREMENTS = REPOSITORY / "docs" / "measurements"


def main() -> None:
    """Fill in each document that is there."""
    for document in DOCUMENTS:
        path = REPOSITORY / document
        if not path.is_file():
            continue
        places = rendered(document, MEASUREMENTS)
        path.write_text(filled_in(path.read_text("utf-8"), places), "utf-8")
        print(f"{document}: {', '.join(places) or 'nothing measured yet'}")


if __name__ == "__main__":
    main()
