// The picture of one image: what is shown, the slider, and the pixel that is read.

const MODES = {
  compare: { text: "Initial | refined", layers: ["before", "after"], tags: ["Initial", "Refined"] },
  photo: { text: "Photo", layers: [] },
  before: { text: "Initial", layers: ["before"], tags: ["Initial"] },
  after: { text: "Refined", layers: ["after"], tags: ["Refined"] },
  difference: { text: "Difference", layers: ["difference"], tags: ["Difference"] },
  confidence: { text: "Confidence", layers: ["confidence"], tags: ["Confidence"], needs: "confidence" },
  error: {
    text: "Error: initial | refined",
    layers: ["errorBefore", "errorAfter"],
    tags: ["Error before", "Error after"],
    needs: "truth",
  },
};

const stage = { index: -1, image: null, maps: null, mode: "compare", probe: null };

async function showImage(index) {
  const image = report.images[index];
  Object.assign(stage, { index, image, maps: null, probe: null });
  byId("stage").style.setProperty("--aspect", image.mapWidth / image.mapHeight);
  byId("stage").classList.toggle("portrait", image.mapHeight > image.mapWidth);
  byId("image-name").textContent = image.name;
  byId("photo").src = blockImageUrl(`image-${index}-photo`);
  byId("photo").alt = `Photo ${image.name}`;
  showModes();
  showImageFacts(image);
  showPixel();
  let maps;
  try {
    maps = await loadMaps(index);
  } catch (error) {
    stageFailed(error);
    return;
  }
  if (stage.index !== index) return; // another image was chosen meanwhile
  stage.maps = maps;
  drawStage();
  showPixel();
  drawHistograms(image, maps);
}

function stageFailed(error) {
  const message = byId("stage-message");
  message.hidden = false;
  message.textContent =
    typeof DecompressionStream === "undefined"
      ? "This browser is too old to show the maps (it lacks DecompressionStream)."
      : `The maps cannot be shown (${error.message}).`;
}

function showModes() {
  const possible = Object.entries(MODES).filter(([, { needs }]) => !needs || stage.image.blocks.includes(needs));
  if (!possible.some(([key]) => key === stage.mode)) stage.mode = "compare";
  segments(byId("modes"), possible.map(([key, { text }]) => [key, text]), stage.mode, (key) => {
    stage.mode = key;
    drawStage();
  });
}

function drawStage() {
  const { image, maps, mode } = stage;
  if (!maps) return;
  const { layers, tags = [] } = MODES[mode];
  const box = byId("stage");
  box.classList.toggle("single", layers.length < 2);
  box.classList.toggle("under", layers.length > 0);
  const canvases = [byId("left-layer"), byId("right-layer")];
  canvases.forEach((canvas) => (canvas.hidden = true));
  const used = layers.length === 2 ? canvases : [canvases[1]];
  layers.forEach((layer, i) => {
    drawLayer(used[i], layer, image, maps);
    used[i].hidden = false;
  });
  byId("left-tag").textContent = tags.length === 2 ? tags[0] : "";
  byId("right-tag").textContent = tags.at(-1) ?? "Photo";
  byId("split").setAttribute("aria-label", `Slide between ${tags[0]} (left) and ${tags[1]} (right)`);
  byId("legend").hidden = layers.length === 0;
  if (layers.length) showLegend(legendOf(mode, image));
}

function showLegend({ colors, ticks, text }) {
  drawColorBar(byId("legend").querySelector("canvas"), colors);
  byId("legend-text").textContent = text;
  const marks = ticks.map(([place, words]) => {
    const mark = make("span", { textContent: words });
    mark.style.left = `${100 * place}%`;
    if (place < 0.03) mark.style.transform = "none";
    if (place > 0.97) mark.style.transform = "translateX(-100%)";
    return mark;
  });
  byId("ticks").replaceChildren(...marks);
}

function showImageFacts(image) {
  const [before, after] = image.filled;
  const rows = [
    ["Size of the maps", `${image.width} × ${image.height} px`],
    ["Refined from", image.input],
    ["Covered", `${percent(before)} → ${percent(after)}`],
    ["Median change", image.change === null ? NOT_KNOWN : percent(image.change, 2)],
    ...image.sources.flatMap(({ name, reason }) => [["Source view", reason ? `${name} (${reason})` : name]]),
    ["Time", duration(image.seconds)],
  ];
  if (image.mapWidth < image.width) rows.splice(1, 0, ["Shown at", `${image.mapWidth} × ${image.mapHeight} px`]);
  if (image.metrics) {
    const [was, is] = image.metrics;
    const pair = (key, text) => `${text(was[key])} → ${text(is[key])}`;
    rows.push(
      ["Mean error", pair("mae", length)],
      ["RMS error", pair("rmse", length)],
      ["Median error", pair("medae", length)],
      ["Off by > 1 %", pair("bad_1", percent)],
      ["Off by > 2 %", pair("bad_2", percent)],
    );
  }
  definitions(byId("image-facts"), rows);
}

// The pixel under the cursor.

function showPixel() {
  const { image, maps, probe } = stage;
  const cross = byId("cross");
  cross.hidden = !probe;
  if (!probe || !maps) {
    byId("where").textContent = "Point at the picture, tap it, or use the arrow keys on it.";
    const rows = ["Initial", "Refined", "Change", "Confidence"].map((term) => [term, NOT_KNOWN]);
    definitions(byId("values"), rows);
    return;
  }
  cross.style.left = `${(100 * (probe.x + 0.5)) / maps.width}%`;
  cross.style.top = `${(100 * (probe.y + 0.5)) / maps.height}%`;
  const full = (at, shown, size) => Math.floor(((at + 0.5) * size) / shown);
  const x = full(probe.x, maps.width, image.width);
  const y = full(probe.y, maps.height, image.height);
  byId("where").textContent = `Column ${x}, row ${y} of the depth map`;
  definitions(byId("values"), pixelRows(maps, probe.y * maps.width + probe.x));
}

function pixelRows(maps, i) {
  const depth = (value) => (value > 0 ? length(value) : "none");
  const change = relativeChange(maps, i);
  const rows = [
    ["Initial", depth(maps.before[i])],
    ["Refined", depth(maps.after[i])],
    ["Change", Number.isNaN(change) ? NOT_KNOWN : signedPercent(change)],
    ["Confidence", maps.confidence ? maps.confidence[i].toFixed(2) : NOT_KNOWN],
  ];
  if (maps.truth) {
    const error = (name) => {
      const value = relativeError(maps, name, i);
      return Number.isNaN(value) ? NOT_KNOWN : percent(value, 2);
    };
    rows.push(["True", depth(maps.truth[i])], ["Error", `${error("before")} → ${error("after")}`]);
  }
  return rows;
}

function probeAt(event) {
  if (!stage.maps) return;
  const box = byId("stage").getBoundingClientRect();
  const place = (at, size, number) => Math.min(number - 1, Math.max(0, Math.floor((at / size) * number)));
  stage.probe = {
    x: place(event.clientX - box.left, box.width, stage.maps.width),
    y: place(event.clientY - box.top, box.height, stage.maps.height),
  };
  showPixel();
}

const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

function moveProbe(event) {
  if (event.target !== byId("stage") || !(event.key in ARROWS) || !stage.maps) return;
  event.preventDefault();
  const { width, height } = stage.maps;
  const [dx, dy] = ARROWS[event.key];
  const step = event.shiftKey ? 10 : 1;
  const from = stage.probe ?? { x: width >> 1, y: height >> 1 };
  const within = (value, number) => Math.min(number - 1, Math.max(0, value));
  stage.probe = { x: within(from.x + step * dx, width), y: within(from.y + step * dy, height) };
  byId("values").setAttribute("aria-live", "polite");
  showPixel();
}

function startStage() {
  const box = byId("stage");
  const split = byId("split");
  const moved = () => {
    box.style.setProperty("--split", `${split.value / 10}%`);
    split.setAttribute("aria-valuetext", `${Math.round(split.value / 10)} % of the width`);
  };
  split.addEventListener("input", moved);
  moved();
  byId("fade").addEventListener("input", (event) => box.style.setProperty("--cover", 1 - event.target.value / 100));
  box.addEventListener("pointermove", (event) => {
    byId("values").removeAttribute("aria-live");
    probeAt(event);
  });
  box.addEventListener("pointerdown", probeAt);
  box.addEventListener("keydown", moveProbe);
}
