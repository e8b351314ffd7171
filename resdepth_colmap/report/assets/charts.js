// Histograms before and after, by uPlot.

const charts = new Map();
const NUM_BINS = 72;
const CHART_HEIGHT_PX = 150;

function quantiles(values, shares) {
  const sorted = Float32Array.from(values).sort();
  return shares.map((share) => sorted[Math.min(sorted.length - 1, Math.floor(share * sorted.length))]);
}

function histogram(values, low, high) {
  const bins = new Float64Array(NUM_BINS);
  const scale = NUM_BINS / (high - low);
  for (const value of values) {
    const bin = Math.floor((value - low) * scale);
    if (bin >= 0 && bin < NUM_BINS) bins[bin] += 1;
    else if (value === high) bins[NUM_BINS - 1] += 1;
  }
  return Array.from(bins, (number) => number / Math.max(1, values.length));
}

function drawChart(id, edges, series, format, tick) {
  const box = byId(id);
  charts.get(id)?.plot.destroy();
  charts.delete(id);
  box.replaceChildren();
  if (!edges) {
    box.append(make("p", { textContent: "Nothing to show." }));
    return;
  }
  const [low, high] = edges;
  const centers = Array.from({ length: NUM_BINS }, (_, i) => low + ((i + 0.5) * (high - low)) / NUM_BINS);
  const faint = () => themeColor("--muted");
  const grid = { stroke: () => themeColor("--line"), width: 1 };
  const font = "12px system-ui, sans-serif";
  const options = {
    width: Math.max(180, box.clientWidth),
    height: CHART_HEIGHT_PX,
    padding: [8, 22, 0, 22],
    cursor: { drag: { x: false, y: false }, points: { size: 6 } },
    scales: { x: { time: false, range: [low, high] }, y: { range: (_, __, max) => [0, max * 1.08 || 1] } },
    axes: [
      { stroke: faint, font, grid, ticks: { show: false }, size: 26, values: (_, marks) => marks.map(tick), space: 56 },
      { show: false },
    ],
    series: [
      { label: "at", value: (_, x) => (x === null ? NOT_KNOWN : format(x)) },
      ...series.map(({ label, color }) => ({
        label,
        stroke: () => themeColor(color),
        fill: () => `${themeColor(color)}38`,
        width: 1.6,
        paths: uPlot.paths.stepped({ align: 0 }),
        points: { show: false },
        value: (_, share) => percent(share, 2),
      })),
    ],
  };
  const data = [centers, ...series.map(({ values }) => histogram(values, low, high))];
  charts.set(id, { plot: new uPlot(options, data, box), box });
}

function resizeCharts() {
  for (const { plot, box } of charts.values()) {
    const width = Math.max(180, box.clientWidth);
    if (width !== plot.width) plot.setSize({ width, height: CHART_HEIGHT_PX });
  }
}

function recolorCharts() {
  for (const { plot } of charts.values()) plot.redraw(false, true);
}

function drawHistograms(image, maps) {
  const depths = (values) => values.filter((depth) => depth > 0);
  const before = depths(maps.before);
  const after = depths(maps.after);
  const [low, high] = after.length ? quantiles(after, [0.005, 0.995]) : [0, 0];
  drawChart(
    "depth-chart",
    high > low ? [low, high] : null,
    [
      { label: "initial", color: "--before", values: before },
      { label: "refined", color: "--after", values: after },
    ],
    length,
    brief,
  );
  drawChanges(image, maps);
}

// The unchanged pixels would be one column that dwarfs all others, so a text counts them.
function drawChanges(image, maps) {
  const changed = [];
  let numBoth = 0;
  for (let i = 0; i < maps.before.length; i++) {
    const change = relativeChange(maps, i);
    if (Number.isNaN(change)) continue;
    numBoth += 1;
    if (Math.abs(change) > image.code.step) changed.push(change);
  }
  const kept = numBoth ? 1 - changed.length / numBoth : 0;
  byId("change-text").textContent = numBoth
    ? `${percent(kept)} of the pixels with an initial depth keep it. The others:`
    : "No pixel has both an initial and a refined depth.";
  drawChart(
    "change-chart",
    changed.length ? [-image.limit, image.limit] : null,
    [{ label: "share of the changed", color: "--after", values: changed }],
    signedPercent,
    (value) => `${brief(100 * value)} %`,
  );
}
