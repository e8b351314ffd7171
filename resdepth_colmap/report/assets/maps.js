// The maps of an image: decoded, as numbers; and drawn, as colours.

const colorTables = new Map();

function colorTable(name) {
  if (!colorTables.has(name)) {
    const text = atob(report.tables[name]);
    colorTables.set(name, Uint8Array.from(text, (letter) => letter.charCodeAt(0)));
  }
  return colorTables.get(name);
}

async function loadDepth(index, name, code) {
  const values = joinedPlanes(await decodePng(blockBytes(`image-${index}-${name}`)));
  return Float32Array.from(values, (v) => (v ? code.nearest * Math.exp((v - 1) * code.step) : 0));
}

async function loadMaps(index) {
  const image = report.images[index];
  const has = (name) => image.blocks.includes(name);
  const [before, after, truth] = await Promise.all(
    ["before", "after", "truth"].map((name) => (has(name) ? loadDepth(index, name, image.code) : null)),
  );
  let confidence = null;
  if (has("confidence")) {
    const png = await decodePng(blockBytes(`image-${index}-confidence`));
    confidence = Float32Array.from(png.values, (v) => v / report.confidenceLevels);
  }
  return { width: image.mapWidth, height: image.mapHeight, before, after, truth, confidence };
}

function relativeChange(maps, i) {
  const before = maps.before[i];
  const after = maps.after[i];
  return before > 0 && after > 0 ? (after - before) / before : NaN;
}

function relativeError(maps, name, i) {
  const truth = maps.truth[i];
  const depth = maps[name][i];
  return truth > 0 && depth > 0 ? Math.abs(depth - truth) / truth : NaN;
}

// For each layer: its colours, and where in 0..1 a pixel lies on them (NaN = no value).
function layerOf(name, image, maps) {
  const { least, most } = image.scale;
  const depth = (values) => (i) => (values[i] > 0 ? (1 / values[i] - least) / (most - least) : NaN);
  const [low, high] = report.errorRange;
  const error = (which) => (i) =>
    Math.log(Math.max(low, relativeError(maps, which, i)) / low) / Math.log(high / low);
  const layers = {
    before: ["depth", depth(maps.before)],
    after: ["depth", depth(maps.after)],
    difference: ["difference", (i) => 0.5 + (0.5 * relativeChange(maps, i)) / image.limit],
    confidence: ["confidence", (i) => (maps.after[i] > 0 ? maps.confidence[i] : NaN)],
    errorBefore: ["error", error("before")],
    errorAfter: ["error", error("after")],
  };
  return layers[name];
}

function drawLayer(canvas, name, image, maps) {
  canvas.width = maps.width;
  canvas.height = maps.height;
  const [colors, place] = layerOf(name, image, maps);
  const table = colorTable(colors);
  const context = canvas.getContext("2d");
  const picture = context.createImageData(maps.width, maps.height);
  const pixels = picture.data;
  for (let i = 0, n = maps.width * maps.height; i < n; i++) {
    const unit = place(i);
    if (Number.isNaN(unit)) continue; // transparent: the photo shows
    const entry = 3 * Math.min(255, Math.max(0, Math.round(255 * unit)));
    pixels[4 * i] = table[entry];
    pixels[4 * i + 1] = table[entry + 1];
    pixels[4 * i + 2] = table[entry + 2];
    pixels[4 * i + 3] = 255;
  }
  context.putImageData(picture, 0, 0);
}

function drawColorBar(canvas, name) {
  const table = colorTable(name);
  const context = canvas.getContext("2d");
  const picture = context.createImageData(256, 1);
  for (let i = 0; i < 256; i++) {
    picture.data.set([table[3 * i], table[3 * i + 1], table[3 * i + 2], 255], 4 * i);
  }
  context.putImageData(picture, 0, 0);
}

// The meaning of the colours: [position in 0..1, text] and a sentence.
function legendOf(mode, image) {
  if (mode === "difference") {
    const limit = brief(100 * image.limit);
    return {
      colors: "difference",
      ticks: [[0, `−${limit} %`], [0.5, "0"], [1, `+${limit} %`]],
      text: "Change of depth: blue = nearer than before, red = farther.",
    };
  }
  if (mode === "confidence") {
    return {
      colors: "confidence",
      ticks: [[0, "0"], [0.5, "0.5"], [1, "1"]],
      text: "Confidence: estimated probability that the refined depth is within 1 % of the truth.",
    };
  }
  if (mode === "error") {
    const [low, high] = report.errorRange;
    const marks = [low, 0.01, high].map((e) => [Math.log(e / low) / Math.log(high / low), `${100 * e} %`]);
    return { colors: "error", ticks: marks, text: "Error against the true depth; logarithmic colours." };
  }
  return {
    colors: "depth",
    ticks: image.scale.ticks,
    text: "Depth in workspace units. No colour = no depth: the photo shows.",
  };
}
