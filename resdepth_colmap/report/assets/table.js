// The table of all images, sorted by any column.

const COLUMNS = [
  { title: "Image", value: (image) => image.name },
  { title: "Covered", value: (image) => image.filled[1], cell: (image) => coverage(image.filled) },
  { title: "Median change", value: (image) => image.change, cell: (image) => percent(image.change, 2) },
  { title: "Source view", value: (image) => image.sources[0]?.name ?? NOT_KNOWN },
  { title: "Time", value: (image) => image.seconds, cell: (image) => duration(image.seconds) },
  errorColumn("Mean error", "mae", length),
  errorColumn("RMS error", "rmse", length),
  errorColumn("Median error", "medae", length),
  errorColumn("Off by > 1 %", "bad_1", percent),
  errorColumn("Off by > 2 %", "bad_2", percent),
];

function errorColumn(title, key, text) {
  return {
    title,
    key,
    text,
    value: (image) => image.metrics?.[1][key] ?? null,
    cell: (image) => judged(image.metrics, key, text),
    needsTruth: true,
  };
}

function coverage([before, after]) {
  const fill = make("i");
  fill.style.width = `${100 * after}%`;
  const bar = make("span", { className: "meter", ariaHidden: "true" }, fill);
  return make("span", {}, percent(before), arrow(), percent(after), bar);
}

function arrow() {
  return make("span", { className: "arrow", textContent: "→" });
}

function judged(metrics, key, text) {
  if (!metrics) return NOT_KNOWN;
  const [before, after] = metrics.map((values) => values[key]);
  const isKnown = before !== null && after !== null && text(before) !== text(after);
  const className = isKnown ? (after < before ? "better" : "worse") : "";
  return make("span", {}, text(before), arrow(), make("b", { className, textContent: text(after) }));
}

function startTable() {
  const hasTruth = report.images.some((image) => image.metrics);
  const columns = COLUMNS.filter((column) => hasTruth || !column.needsTruth);
  const table = byId("image-table");
  const body = make("tbody");
  const heads = columns.map((column, i) => {
    const button = make("button", { type: "button", textContent: column.title });
    button.addEventListener("click", () => sortBy(i));
    return make("th", { scope: "col" }, button);
  });
  const rows = report.images.map((image, index) => ({ image, element: tableRow(columns, image, index) }));
  body.append(...rows.map(({ element }) => element));
  table.append(make("thead", {}, make("tr", {}, ...heads)), body);
  if (hasTruth) table.append(make("tfoot", {}, meanRow(columns)));

  function sortBy(place) {
    const isDown = heads[place].getAttribute("aria-sort") === "ascending";
    heads.forEach((head) => head.removeAttribute("aria-sort"));
    heads[place].setAttribute("aria-sort", isDown ? "descending" : "ascending");
    const { value } = columns[place];
    const compared = (a, b) => (typeof a === "string" ? a.localeCompare(b, undefined, { numeric: true }) : (a ?? -1) - (b ?? -1));
    rows.sort((a, b) => (isDown ? -1 : 1) * compared(value(a.image), value(b.image)));
    body.append(...rows.map(({ element }) => element));
  }
}

function tableRow(columns, image, index) {
  const open = make("button", { type: "button", textContent: image.name, title: `Show ${image.name}` });
  open.addEventListener("click", () => {
    chooseImage(index);
    byId("images").scrollIntoView();
  });
  const cells = columns.slice(1).map(({ value, cell }) => make("td", {}, cell ? cell(image) : value(image)));
  return make("tr", {}, make("th", { scope: "row" }, open), ...cells);
}

function meanRow(columns) {
  const cells = columns.slice(1).map(({ key, text }) => make("td", {}, key ? judged(report.summary.metrics, key, text) : ""));
  return make("tr", {}, make("th", { scope: "row", textContent: "Mean" }), ...cells);
}
