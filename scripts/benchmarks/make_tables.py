"""Fill the tables of the documents from docs/measurements/*.json.

    python -m scripts.benchmarks.make_tables

Run it after a benchmark, or after other weights are put into the package (their figures
go to docs/measurements/weights.json). A test fails while documents and figures differ.
"""

from resdepth_colmap.network.weights import default_weights_path
from scripts.benchmarks.record import MEASUREMENTS, REPOSITORY, write
from scripts.benchmarks.tables.documents import DOCUMENTS, filled_in, rendered
from scripts.benchmarks.tables.weights_facts import weights_facts


def main() -> None:
    """Read the weights, and fill each document that exists."""
    write(MEASUREMENTS / "weights.json", weights_facts(default_weights_path()))
    for document in DOCUMENTS:
        path = REPOSITORY / document
        if not path.is_file():
            continue
        blocks = rendered(document, MEASUREMENTS)
        path.write_text(filled_in(path.read_text("utf-8"), blocks), "utf-8")
        print(f"{document}: {', '.join(blocks) or 'nothing measured yet'}")


if __name__ == "__main__":
    main()
