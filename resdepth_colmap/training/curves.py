"""The training curves as a picture."""

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from resdepth_colmap.scene import ColorImage
from resdepth_colmap.training.log import Row
from resdepth_colmap.viz.panels import rendered

_PANELS = {
    "loss": {"loss": "training", "held_out_loss": "held out"},
    "error, refined / initial: held-out scenes": {
        "held_out_mae_ratio": "mean",
        "held_out_medae_ratio": "median",
        "held_out_off_ratio": "off by > 2 %",
    },
    "error, refined / initial: watched scenes": {
        "watched_mae_ratio": "mean",
        "watched_medae_ratio": "median",
        "watched_off_ratio": "off by > 2 %",
    },
    "learning rate": {"learning_rate": "learning rate"},
}


def draw_curves(rows: Sequence[Row]) -> ColorImage:
    """Draw losses, ratios of errors and learning rate over the steps.

    Args:
        rows: Lines of the log; a panel without values is left out.

    Returns:
        RGB values, shape (height, width, 3), uint8.
    """
    panels = {
        title: names
        for title, names in _PANELS.items()
        if any(name in row for row in rows for name in names)
    }
    figure = Figure(figsize=(8, 2.8 * max(len(panels), 1)), layout="constrained")
    for index, (title, names) in enumerate(panels.items()):
        axes = figure.add_subplot(len(panels), 1, index + 1)
        _draw(axes, rows, names)
        axes.set_title(title, loc="left", fontsize=10)
    return rendered(figure)


def _draw(axes: Axes, rows: Sequence[Row], names: dict[str, str]) -> None:
    for name, label in names.items():
        points = [(row["step"], row[name]) for row in rows if name in row]
        if points:
            axes.plot(*zip(*points, strict=True), label=label, marker=".", markersize=3)
    if any("ratio" in name for name in names):
        axes.axhline(1.0, color="0.6", linewidth=0.8)  # above it: harm
    axes.set_xlabel("step")
    axes.set_ylim(bottom=0)
    axes.grid(alpha=0.3)
    if len(names) > 1:
        axes.legend(fontsize=8)
