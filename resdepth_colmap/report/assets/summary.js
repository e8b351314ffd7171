// The head of the page, and the details at its end.

const STAGE_COLORS = ["#4c78a8", "#0b7a75", "#b7791f", "#e2b96b", "#8b6bb1", "#9aa1ab", "#c4576b"];

function showSummary() {
  const facts = report.summary;
  showLede(facts);
  const cards = [coverageCard(facts), agreementCard(facts), pointsCard(facts), ...errorCards(facts), timeCard(facts)];
  const shown = cards.filter((card) => card !== null);
  byId("cards").style.setProperty("--columns", shown.length % 3 === 0 ? 3 : Math.min(4, shown.length));
  byId("cards").replaceChildren(...shown);
  showNotes(facts);
  showDetails(facts);
}

function showLede(facts) {
  const [before, after] = facts.coverage;
  const lede = byId("lede");
  const images = facts.num_images === 1 ? "1 image" : `${count(facts.num_images)} images`;
  lede.append(make("b", { textContent: images }), " refined");
  const finished = new Date(facts.finished);
  if (facts.finished && !Number.isNaN(finished.getTime())) {
    lede.append(` on ${finished.toLocaleDateString("en-GB", { day: "numeric", month: "long", year: "numeric" })}`);
  }
  lede.append(". ");
  if (before !== null && after !== null && after - before > 0.0005) {
    lede.append("Depth now covers ", make("b", { textContent: percent(after) }), ` of the pixels; it was ${percent(before)}. `);
  }
  if (facts.metrics) {
    const [was, is] = facts.metrics;
    const change = is.mae / was.mae - 1;
    lede.append(
      "The mean error against the true depth ",
      make("b", { textContent: `${change < 0 ? "fell" : "rose"} by ${percent(Math.abs(change), 0)}` }),
      ".",
    );
  }
}

function card(title, before, after, notes, shares) {
  const big = make("div", { className: "big", textContent: after });
  if (before !== null) big.append(make("span", { className: "was", textContent: `was ${before}` }));
  const box = make("div", { className: "panel card" }, make("h3", { textContent: title }), big);
  if (shares) {
    const bars = make("div", { className: "bars", ariaHidden: "true" });
    ["before", "after"].forEach((kind, i) => {
      if (shares[i] === null) return;
      const fill = make("i");
      fill.style.width = `${100 * Math.min(1, shares[i])}%`;
      bars.append(make("span", { className: kind }, fill));
    });
    box.append(bars);
  }
  if (notes) box.append(make("p", { textContent: notes }));
  return box;
}

function coverageCard({ coverage: [before, after] }) {
  return card("Coverage", percent(before), percent(after), "Share of the pixels that have a depth.", [before, after]);
}

function agreementCard({ agreement: [before, after], consistent, num_views_needed: needed }) {
  if (after === null) return null;
  const views = needed ? `${needed} views` : "the views";
  const all = consistent[0] === null ? percent(consistent[1]) : `${percent(consistent[0])} → ${percent(consistent[1])}`;
  const text = `Share of the depths that are consistent in ${views}; ${all} of all pixels.`;
  return card("Consistency across views", before === null ? null : percent(before), percent(after), text, [before, after]);
}

function pointsCard({ points: [before, after] }) {
  if (after === null) return null;
  const most = Math.max(before ?? 0, after);
  const text = "Points of the fused cloud" + (before === null ? "." : "; before: the initial maps, fused by the same rule.");
  return card("Points", before === null ? null : count(before), count(after), text, [before === null ? null : before / most, after / most]);
}

function errorCards({ metrics }) {
  if (!metrics) return [];
  const [was, is] = metrics;
  const most = Math.max(was.mae, is.mae) || 1;
  return [
    card("Mean error", length(was.mae), length(is.mae), "Against the true depth, in workspace units; mean of the images.", [was.mae / most, is.mae / most]),
    card("Off by more than 2 %", percent(was.bad_2), percent(is.bad_2), "Share of the pixels whose true depth is known.", [was.bad_2, is.bad_2]),
  ];
}

function timeCard({ seconds, peak_memory_mb: memory, device }) {
  const stages = Object.entries(seconds);
  if (!stages.length) return null;
  const all = stages.reduce((sum, [, s]) => sum + s, 0);
  const where = [device, memory ? `${(memory / 1024).toFixed(1)} GiB of memory` : ""].filter(Boolean).join(", ");
  const box = card("Time", null, duration(all), "", null);
  box.classList.add("broad");
  const bar = make("div", { className: "stages", ariaHidden: "true" });
  const list = make("ul", { className: "stage-list" });
  stages.forEach(([stage, value], i) => {
    const color = STAGE_COLORS[i % STAGE_COLORS.length];
    const part = make("i");
    part.style.flexGrow = value;
    part.style.background = color;
    bar.append(part);
    const key = make("i");
    key.style.background = color;
    list.append(make("li", {}, key, `${spoken(stage)} ${duration(value)}`));
  });
  box.append(bar, list);
  if (where) box.append(make("p", { textContent: where }));
  return box;
}

function showNotes(facts) {
  const notes = byId("notes");
  const say = (text) => notes.append(make("p", { className: "note", textContent: text }));
  if (facts.fuse_error) say(`No cloud: ${facts.fuse_error}`);
  if (facts.num_images > report.images.length + report.leftOut.length) {
    say(`${count(report.images.length)} of ${count(facts.num_images)} images are shown here, evenly chosen; the numbers above are of all.`);
  }
  for (const { reason, names } of report.leftOut) say(`${names.join(", ")}: not shown. ${reason}`);
  for (const { reason, count: total } of report.skipped) {
    say(`${count(total)} ${total === 1 ? "image was" : "images were"} not refined: ${reason} (see Details).`);
  }
}

function showDetails(facts) {
  const list = byId("detail-list");
  const flat = (value) => (value === null ? "default" : typeof value === "object" ? JSON.stringify(value) : String(value));
  const columns = Object.entries(facts.options)
    .filter(([, value]) => value !== null && typeof value === "object")
    .map(([stage, values]) => detailColumn(spoken(stage), Object.entries(values).map(([k, v]) => [spoken(k), flat(v)])));
  const rest = Object.entries(facts.options).filter(([, value]) => value === null || typeof value !== "object");
  if (rest.length) columns.push(detailColumn("Run", rest.map(([k, v]) => [spoken(k), flat(v)])));
  if (columns.length) list.append(detail("Options", columns));
  const made = [["Workspace", facts.workspace], ["Initial depth", facts.stereo], ["Device", facts.device], ["Weights", facts.weights.slice(0, 12)], ["Finished", facts.finished]];
  list.append(
    detail("Versions and origin", [
      detailColumn("Made of", made.filter(([, value]) => value)),
      detailColumn("Versions", Object.entries(facts.versions).map(([k, v]) => [k, flat(v)])),
    ]),
  );
  for (const { reason, count: total, names } of report.skipped) {
    const more = total > names.length ? [`and ${count(total - names.length)} more`] : [];
    const items = [...names, ...more].map((name) => make("li", { textContent: name }));
    list.append(detail(`Not refined: ${reason}`, [make("ul", {}, ...items)]));
  }
  const precision = report.images.length ? ` Depths in this page are exact to ${percent(report.images[0].code.step / 2, 3)}.` : "";
  byId("foot").textContent = `Written by resdepth-colmap ${facts.versions["resdepth-colmap"] ?? ""}.${precision}`;
}

function detail(title, children) {
  return make(
    "details",
    { className: "panel" },
    make("summary", { textContent: title }),
    make("div", { className: "columns" }, ...children),
  );
}

function detailColumn(title, rows) {
  const list = make("dl", { className: "facts" });
  definitions(list, rows);
  return make("div", {}, make("h4", { textContent: title }), list);
}
